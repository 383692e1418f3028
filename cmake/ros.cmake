# The ROS side of the build: what the node links, what is installed, and the rostests. Included by CMakeLists.txt after
# the node's target.

find_package(roslib REQUIRED)
target_include_directories(${PROJECT_NAME}_ros SYSTEM PRIVATE ${roslib_INCLUDE_DIRS})
target_link_libraries(${PROJECT_NAME}_ros PRIVATE ${roslib_LIBRARIES})

target_compile_definitions(${PROJECT_NAME}_ros PRIVATE MESHLESS_SURGERY_VERSION="${${PROJECT_NAME}_VERSION}")

target_include_directories(deformer_node PRIVATE include)

# --- install
# scripts/train and scripts/check are for a checkout; tests and clients are installed by catkin_install_python below.
#catkin_lint: ignore uninstalled_script
set(room_targets)
foreach(room IN LISTS core_rooms)
  list(APPEND room_targets ${PROJECT_NAME}_${room})
endforeach()
# The linter does not look into add_room().
#catkin_lint: ignore_once undefined_target
install(TARGETS ${PROJECT_NAME}_ros ${room_targets}
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION})
install(TARGETS deformer_node drive make_meshes replay ${bench_targets}
  RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
install(DIRECTORY include/${PROJECT_NAME}/
  DESTINATION ${CATKIN_PACKAGE_INCLUDE_DESTINATION}
  FILES_MATCHING PATTERN "*.h")
install(DIRECTORY config launch
  DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
file(GLOB client_scripts RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS scripts/*.py)
if(client_scripts)
  #catkin_lint: ignore_once argument_error
  catkin_install_python(PROGRAMS ${client_scripts}
    DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endif()
