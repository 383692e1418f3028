# One test program a room, of all test/<room>/*_test.cpp: a new file needs no line here. Included where tests are built,
# after enable_testing(). ctest runs a program in several entries side by side, each a share of its cases.
find_package(GTest REQUIRED)

# Headers that nearly all of them read.
set(test_headers <gtest/gtest.h> <Eigen/Dense> <meshless_surgery/world/world.h>)

# add_test_entries(NAME PROGRAM SHARES LABELS...): ctest's entries.
function(add_test_entries name program shares)
  math(EXPR last "${shares} - 1")
  foreach(share RANGE ${last})
    set(entry ${name})
    if(shares GREATER 1)
      string(APPEND entry _${share})
    endif()
    set(share_of env GTEST_TOTAL_SHARDS=${shares} GTEST_SHARD_INDEX=${share})
    if(MESHLESS_SURGERY_CORE_ONLY)
      add_test(NAME ${entry} COMMAND ${share_of} $<TARGET_FILE:${program}>
        --gtest_output=xml:${CMAKE_BINARY_DIR}/test_results/gtest-${entry}.xml)
    else()
      set(results gtest-${entry}.xml)
      list(JOIN share_of " " share_of)  # catkin takes a command as one text
      catkin_run_tests_target(gtest ${entry} ${results} DEPENDENCIES ${program}
        COMMAND "${share_of} $<TARGET_FILE:${program}> --gtest_output=xml:${CATKIN_TEST_RESULTS_DIR}/${PROJECT_NAME}/${results}")
      set(entry _ctest_${PROJECT_NAME}_gtest_${entry})
    endif()
    set(labels ${ARGN})
    if(MESHLESS_SURGERY_SANITIZE AND shares GREATER 4)
      math(EXPR part "${share} % 4")
      list(APPEND labels part_${part})
    endif()
    set_tests_properties(${entry} PROPERTIES LABELS "${labels}" COST ${shares})
  endforeach()
endfunction()

# add_test_program(NAME SHARES SOURCES file... LINKS library... LABELS label...)
function(add_test_program name shares)
  cmake_parse_arguments(TEST "" "" "SOURCES;LINKS;LABELS" ${ARGN})
  set(program ${name}_tests)
  add_executable(${program} ${TEST_SOURCES})
  target_include_directories(${program} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/test ${CMAKE_CURRENT_SOURCE_DIR}/src)
  target_compile_definitions(${program} PRIVATE SOURCE_DIR="${CMAKE_CURRENT_SOURCE_DIR}")
  target_link_libraries(${program} ${TEST_LINKS} GTest::gtest GTest::gtest_main Threads::Threads)
  add_test_entries(${name} ${program} ${shares} ${TEST_LABELS})
  # What scripts/check builds for a room, or for the tier of all.
  list(GET TEST_LABELS -1 label)
  if(NOT TARGET check_${label})
    add_custom_target(check_${label})
  endif()
  add_dependencies(check_${label} ${program})
  if(NOT MESHLESS_SURGERY_CORE_ONLY)
    set_target_properties(${program} PROPERTIES EXCLUDE_FROM_ALL TRUE)
    add_dependencies(tests ${program})
  endif()
endfunction()

# What they test is in the libraries; their own loops are short. The headers are compiled once for all of them.
function(share_test_headers program)
  target_compile_options(${program} PRIVATE -O1)
  if(TARGET base_tests AND NOT program STREQUAL base_tests)
    target_precompile_headers(${program} REUSE_FROM base_tests)
  else()
    target_precompile_headers(${program} PRIVATE ${test_headers})
  endif()
endfunction()

# The shares in which a room's cases run: more than one where they take long.
set(shares_stress 6)
set(shares_world 6)
set(shares_accuracy 4)
set(shares_geometry 3)
set(shares_body 2)
set(shares_dynamics 2)
set(shares_contact 2)
set(shares_io 2)
# Under sanitizers they take an hour and more: scripts/check --full runs one of four parts, another one each day.
if(MESHLESS_SURGERY_SANITIZE)
  set(shares_world 16)
  set(shares_body 8)
endif()

set(links_io ${PROJECT_NAME}_io JPEG::JPEG PNG::PNG ZLIB::ZLIB)
set(links_world tried_drive ZLIB::ZLIB)  # its bowl; forged states have the right checksum
set(links_stress ${PROJECT_NAME}_io)
set(links_drive tried_drive)
set(links_training ${PROJECT_NAME}_training)
set(links_accuracy bench_truth bench_pile ${PROJECT_NAME}_io)

# The accuracy tests are many steps of plain arithmetic: nothing that sanitizers have not seen in the rooms.
set(test_rooms base ${core_rooms} drive stress)
if(NOT MESHLESS_SURGERY_SANITIZE)
  list(APPEND test_rooms accuracy)
endif()
foreach(room IN LISTS test_rooms)
  file(GLOB room_tests CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/test/${room}/*_test.cpp)
  # Alone: the one replaces operator new, the other is CGAL's templates for a minute.
  list(FILTER room_tests EXCLUDE REGEX "/(world/work|geometry/cut_oracle)_test\\.cpp$")
  if(NOT shares_${room})
    set(shares_${room} 1)
  endif()
  add_test_program(${room} ${shares_${room}} SOURCES ${room_tests} LABELS ${room}
    LINKS ${PROJECT_NAME}_world tried_shapes ${links_${room}})
  if(NOT room STREQUAL accuracy)
    share_test_headers(${room}_tests)
  endif()
endforeach()

add_test_program(world_work 1 SOURCES test/world/work_test.cpp LABELS world LINKS ${PROJECT_NAME}_world tried_shapes bench_pile)
share_test_headers(world_work_tests)

if(NOT MESHLESS_SURGERY_SANITIZE OR MESHLESS_SURGERY_SANITIZE_ALL)
  add_test_program(geometry_oracle 1 SOURCES test/geometry/cut_oracle_test.cpp LABELS geometry full
    LINKS ${PROJECT_NAME}_world tried_shapes bench_clip CGAL::CGAL)
endif()
