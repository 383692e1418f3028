# Benchmarks: executables without ROS. Built where their libraries are; a source file bench/<name>.cpp with a line below.
find_package(benchmark QUIET)
find_package(CLI11 QUIET)
set(bench_targets)

function(add_bench name)
  add_executable(${name} ${ARGN})
  target_compile_options(${name} PRIVATE -Wall -Wextra -Wpedantic)
  target_compile_definitions(${name} PRIVATE TRUTH_FOLDER="${CMAKE_CURRENT_SOURCE_DIR}/bench/truth/data")
  target_link_libraries(${name} ${PROJECT_NAME}_world Threads::Threads)
  set(bench_targets ${bench_targets} ${name} PARENT_SCOPE)
endfunction()

set(truth_sources ${CMAKE_CURRENT_SOURCE_DIR}/bench/static_load.cpp ${CMAKE_CURRENT_SOURCE_DIR}/bench/truth_case.cpp)

if(CLI11_FOUND)
  add_bench(accuracy bench/accuracy.cpp ${truth_sources})
  target_link_libraries(accuracy CLI11::CLI11)
endif()
if(benchmark_FOUND)
  add_bench(bench_rotation bench/bench_rotation.cpp)
  target_link_libraries(bench_rotation benchmark::benchmark)
endif()
