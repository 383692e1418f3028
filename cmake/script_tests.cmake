# Tests that are neither gtest nor rostest: the include directions, the pages, and the scripts.
# Included where tests are built, after enable_testing().

add_test(NAME include_direction
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/include_direction_test.py)
add_test(NAME docs
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/docs_test.py)
foreach(test IN ITEMS reference reference_keys reference_limits)
  add_test(NAME ${test}
    COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/${test}_test.py)
  set_tests_properties(${test} PROPERTIES LABELS scripts)
endforeach()
add_test(NAME messages
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/messages_test.py)
add_test(NAME package
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/package_test.py)
add_test(NAME falls_short
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/falls_short_test.py)
add_test(NAME learning_curves
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/learning_curves_test.py)
add_test(NAME teleoperation
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/teleoperation_test.py)
add_test(NAME test_summary
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/scripts/lib/test_summary_test.py)
add_test(NAME loopback_by_default
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/scripts/lib/environment_test.py)
add_test(NAME check_arguments
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/scripts/lib/check_test.py)
if(NOT MESHLESS_SURGERY_CORE_ONLY)
  add_test(NAME strict_rostest
    COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/scripts/lib/strict_rostest_test.py)
  set_tests_properties(strict_rostest PROPERTIES LABELS scripts)
endif()
set_tests_properties(include_direction docs messages package falls_short learning_curves teleoperation test_summary loopback_by_default check_arguments PROPERTIES LABELS scripts)
# The headers' own documentation, without a warning.
add_test(NAME doxygen COMMAND ${CMAKE_COMMAND} -E env DOXYGEN_OUTPUT=${CMAKE_BINARY_DIR}/api
  doxygen ${CMAKE_CURRENT_SOURCE_DIR}/docs/Doxyfile WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/api)
# The install space, and what others build against it.
add_test(NAME install COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/install_test.py ${CMAKE_BINARY_DIR})
set_tests_properties(doxygen install PROPERTIES LABELS "scripts;full")
set_tests_properties(install PROPERTIES RUN_SERIAL TRUE TIMEOUT 3000)
add_custom_target(check_scripts)
