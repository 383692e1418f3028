# Tests that are neither gtest nor rostest: the include directions, and the scripts.
# Included where tests are built, after enable_testing().

add_test(NAME include_direction
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/test/include_direction_test.py)
add_test(NAME test_summary
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/scripts/lib/test_summary_test.py)
add_test(NAME loopback_by_default
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/scripts/lib/environment_test.py)
add_test(NAME check_arguments
  COMMAND /usr/bin/python3 -B ${CMAKE_CURRENT_SOURCE_DIR}/scripts/lib/check_test.py)
set_tests_properties(include_direction test_summary loopback_by_default check_arguments PROPERTIES LABELS scripts)
add_custom_target(check_scripts)
