# The rooms without ROS for other projects: find_package(meshless_surgery_rooms), targets meshless_surgery::world and the like. See
# examples/rooms. Included by CMakeLists.txt after the rooms.
include(CMakePackageConfigHelpers)

set(rooms_version ${${PROJECT_NAME}_VERSION})
if(NOT rooms_version)  # without catkin
  file(STRINGS package.xml rooms_version REGEX "<version>")
  string(REGEX REPLACE ".*<version>(.*)</version>.*" "\\1" rooms_version "${rooms_version}")
endif()
set(rooms_folder ${CMAKE_INSTALL_LIBDIR}/cmake/${PROJECT_NAME}_rooms)
if(NOT CMAKE_INSTALL_LIBDIR)  # catkin names it where the prefix is /usr
  set(rooms_folder lib/cmake/${PROJECT_NAME}_rooms)
endif()

set(room_targets)
foreach(room IN LISTS core_rooms)
  list(APPEND room_targets ${PROJECT_NAME}_${room})
  # They find each other without the environment of ROS.
  set_target_properties(${PROJECT_NAME}_${room} PROPERTIES EXPORT_NAME ${room} INSTALL_RPATH "$ORIGIN")
endforeach()
# The linter does not look into add_room().
#catkin_lint: ignore_once undefined_target
install(TARGETS ${room_targets} EXPORT ${PROJECT_NAME}_rooms
  ARCHIVE DESTINATION ${MESHLESS_SURGERY_LIBRARY_FOLDER}
  LIBRARY DESTINATION ${MESHLESS_SURGERY_LIBRARY_FOLDER}
  RUNTIME DESTINATION bin)
install(DIRECTORY include/${PROJECT_NAME}/
  DESTINATION include/${PROJECT_NAME}
  FILES_MATCHING PATTERN "*.h")
install(EXPORT ${PROJECT_NAME}_rooms NAMESPACE ${PROJECT_NAME}:: DESTINATION ${rooms_folder})
configure_package_config_file(cmake/rooms-config.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}_rooms-config.cmake
  INSTALL_DESTINATION ${rooms_folder})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}_rooms-config-version.cmake
  VERSION ${rooms_version} COMPATIBILITY SameMinorVersion)
# Made when configuring.
#catkin_lint: ignore_once missing_file
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}_rooms-config.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}_rooms-config-version.cmake
  DESTINATION ${rooms_folder})
