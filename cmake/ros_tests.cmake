# Tests of the ROS side: one program of test/ros/*_test.cpp, and the rostests, each with a master of its own. Included where
# tests are built.
if(CATKIN_ENABLE_TESTING)
  find_package(rostest REQUIRED)
endif()

file(GLOB ros_unit_tests CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/test/ros/*_test.cpp)
add_test_program(ros 1 SOURCES ${ros_unit_tests} LABELS ros LINKS ${PROJECT_NAME}_ros ${catkin_LIBRARIES})
target_include_directories(ros_tests SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
add_dependencies(check_ros launched)
add_dependencies(check_drive drive)  # scripts/check plays random scenes with it
add_custom_target(check_rviz DEPENDS launched)
if(TARGET ${PROJECT_NAME}_rviz)
  file(GLOB rviz_unit_tests CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/test/rviz/*_test.cpp)
  add_test_program(rviz 1 SOURCES ${rviz_unit_tests} LABELS rviz LINKS ${PROJECT_NAME}_rviz ${catkin_LIBRARIES})
  target_include_directories(rviz_tests PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/src/rviz)
  target_include_directories(rviz_tests SYSTEM PRIVATE ${catkin_INCLUDE_DIRS} ${OGRE_INCLUDE_DIRS})
  target_link_libraries(rviz_tests Qt5::Widgets)
endif()

# Through catkin_install_python, which names the interpreter: another python3 may come first on the PATH.
file(GLOB test_scripts RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS test/ros/*.py test/rviz/*.py)
if(test_scripts)
  #catkin_lint: ignore_once argument_error
  catkin_install_python(PROGRAMS ${test_scripts}
    DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endif()

# For scripts/check --full: what takes long for what it adds.
set(full_tests camera_by_mouse clip devices display ending forces fuzz hands lead network own_organ own_package pages parameters play_abdomen play_block play_fish play_incision play_liver_looks play_peg_transfer play_pile play_resection
  play_skin requests robust scenes session shown_block shown_fish shown_review shown_skin soak stations)
# A node keeps one processor busy, and a screen is drawn by software: tests run alone. These wait for what they ask for,
# however long it takes, or hold the clock themselves.
set(patient_tests actions client clock contacts environment forces lab messages_law network own_organ pages parameters publish_clock requests scenes services session spawn_cloud stations testing time tools training)
file(GLOB ros_tests RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS test/ros/*.test test/rviz/*.test)
set(known_tests ${ros_tests})
list(TRANSFORM known_tests REPLACE ".*/(.*)\\.test$" "\\1")
foreach(name IN LISTS full_tests patient_tests)
  if(NOT name IN_LIST known_tests)
    message(FATAL_ERROR "there is no rostest ${name}")
  endif()
endforeach()
foreach(ros_test IN LISTS ros_tests)
  # As add_rostest() does it, by a stricter rostest.
  string(REPLACE "/" "_" results ${ros_test})
  string(REPLACE ".test" ".xml" results ${results})
  string(CONCAT strict_rostest "${PYTHON_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/scripts/lib/strict_rostest.py"
    " --pkgdir=${PROJECT_SOURCE_DIR} --package=${PROJECT_NAME} --results-filename ${results}"
    " --results-base-dir \"${CATKIN_TEST_RESULTS_DIR}\" ${CMAKE_CURRENT_SOURCE_DIR}/${ros_test}")
  string(REPLACE "/" "_" test_target ${ros_test})
  catkin_run_tests_target(rostest ${test_target} rostest-${results} COMMAND ${strict_rostest} DEPENDENCIES deformer_node review_node)
  get_filename_component(test_name ${ros_test} NAME_WE)
  get_filename_component(room ${ros_test} DIRECTORY)
  get_filename_component(room ${room} NAME)
  string(REPLACE "/" "_" test_entry ${ros_test})
  set(test_entry _ctest_${PROJECT_NAME}_rostest_${test_entry})
  set(labels ${room})
  if(test_name IN_LIST full_tests)
    list(APPEND labels full)
  endif()
  set_tests_properties(${test_entry} PROPERTIES LABELS "${labels}")
  if(NOT test_name IN_LIST patient_tests)
    set_tests_properties(${test_entry} PROPERTIES RUN_SERIAL TRUE)
  elseif(test_name STREQUAL session)
    set_tests_properties(${test_entry} PROPERTIES COST 120)  # the longest, beside all the others
  endif()
endforeach()
