# The rviz plugin: tools, panel and display. It knows the node by messages and services alone, and is built where rviz is
# found: a machine that only simulates needs neither rviz nor Qt.
find_package(rviz QUIET)
find_package(pluginlib QUIET)
find_package(roslib QUIET)  # rviz needs it, too
find_package(Qt5 QUIET COMPONENTS Widgets)
if(NOT rviz_FOUND OR NOT pluginlib_FOUND OR NOT Qt5_FOUND)
  message(STATUS "rviz, pluginlib or Qt5 was not found: the rviz plugin is not built")
  return()
endif()

file(GLOB rviz_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/src/rviz/*.cpp ${CMAKE_CURRENT_SOURCE_DIR}/src/rviz/*.h)
add_library(${PROJECT_NAME}_rviz SHARED ${rviz_sources})
set_target_properties(${PROJECT_NAME}_rviz PROPERTIES AUTOMOC ON)
target_compile_definitions(${PROJECT_NAME}_rviz PRIVATE QT_NO_KEYWORDS)
target_compile_options(${PROJECT_NAME}_rviz PRIVATE -Wall -Wextra -Wpedantic)
target_include_directories(${PROJECT_NAME}_rviz SYSTEM PRIVATE
  ${catkin_INCLUDE_DIRS} ${rviz_INCLUDE_DIRS} ${pluginlib_INCLUDE_DIRS} ${roslib_INCLUDE_DIRS} ${OGRE_INCLUDE_DIRS})
target_link_libraries(${PROJECT_NAME}_rviz PRIVATE ${catkin_LIBRARIES} ${rviz_LIBRARIES} ${pluginlib_LIBRARIES} ${roslib_LIBRARIES} Qt5::Widgets)
add_dependencies(${PROJECT_NAME}_rviz ${PROJECT_NAME}_generate_messages_cpp ${catkin_EXPORTED_TARGETS})

install(TARGETS ${PROJECT_NAME}_rviz
  ARCHIVE DESTINATION ${MESHLESS_SURGERY_PLUGIN_FOLDER}
  LIBRARY DESTINATION ${MESHLESS_SURGERY_PLUGIN_FOLDER}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION})
install(FILES rviz_plugin.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
install(DIRECTORY icons media DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
