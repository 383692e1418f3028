# The ROS side of the build: what the node links, what is installed, and the rostests. Included by CMakeLists.txt after
# the node's target.

find_package(roslib REQUIRED)
target_include_directories(${PROJECT_NAME}_ros SYSTEM PRIVATE ${roslib_INCLUDE_DIRS})
target_link_libraries(${PROJECT_NAME}_ros PRIVATE ${roslib_LIBRARIES})

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
install(TARGETS deformer_node make_meshes replay ${bench_targets}
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

# --- tests with a roscore; each .test file has its own
if(CATKIN_ENABLE_TESTING)
  find_package(rostest REQUIRED)
  # Through catkin_install_python, which names the interpreter: another python3 may come first on the PATH.
  file(GLOB test_scripts RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS test/ros/*.py test/rviz/*.py)
  if(test_scripts)
    #catkin_lint: ignore_once argument_error
    catkin_install_python(PROGRAMS ${test_scripts}
      DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
  endif()
  file(GLOB ros_tests RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS test/ros/*.test test/rviz/*.test)
  # A node keeps one processor busy, and most tests look at the clock of the simulation or at a screen that is drawn by
  # software: they run alone. These wait for what they ask for, however long it takes.
  set(patient_tests contacts parameters scenes services session stations tools)
  foreach(ros_test IN LISTS ros_tests)
    add_rostest(${ros_test} DEPENDENCIES deformer_node)
    get_filename_component(test_name ${ros_test} NAME_WE)
    string(REPLACE "/" "_" test_entry ${ros_test})
    set(test_entry _ctest_${PROJECT_NAME}_rostest_${test_entry})
    if(NOT test_name IN_LIST patient_tests)
      set_tests_properties(${test_entry} PROPERTIES RUN_SERIAL TRUE)
    elseif(test_name STREQUAL session)
      set_tests_properties(${test_entry} PROPERTIES COST 120)  # the longest, beside all the others
    endif()
  endforeach()
  file(GLOB ros_unit_tests CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/test/ros/*_test.cpp)
  foreach(source IN LISTS ros_unit_tests)
    get_filename_component(test_name ${source} NAME_WE)
    catkin_add_gtest(ros_${test_name} ${source})
    target_include_directories(ros_${test_name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/test)
    target_link_libraries(ros_${test_name} ${PROJECT_NAME}_ros ${catkin_LIBRARIES} GTest::gtest_main Threads::Threads)
  endforeach()
endif()
