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

set(truth_sources ${CMAKE_CURRENT_SOURCE_DIR}/bench/static_load.cpp ${CMAKE_CURRENT_SOURCE_DIR}/bench/truth_case.cpp
    ${CMAKE_CURRENT_SOURCE_DIR}/bench/laws.cpp)

set(pile_sources ${CMAKE_CURRENT_SOURCE_DIR}/bench/contact_pile.cpp)

if(MESHLESS_SURGERY_SANITIZE)  # the core and its tests alone
  return()
endif()

if(CLI11_FOUND)
  add_bench(accuracy bench/accuracy.cpp bench/plot.cpp ${truth_sources})
  target_link_libraries(accuracy CLI11::CLI11)
endif()
if(benchmark_FOUND)
  add_bench(bench_rotation bench/bench_rotation.cpp)
  target_link_libraries(bench_rotation benchmark::benchmark)
  add_bench(bench_step bench/bench_step.cpp bench/step_rows.cpp bench/step_pile.cpp bench/step_lattice.cpp
    bench/step_cells.cpp bench/step_liver.cpp)
  target_link_libraries(bench_step benchmark::benchmark)
  add_bench(bench_cut bench/bench_cut.cpp bench/cut_cgal_clip.cpp)
  target_link_libraries(bench_cut benchmark::benchmark CGAL::CGAL)
  add_bench(bench_incise bench/bench_incise.cpp)
  target_link_libraries(bench_incise benchmark::benchmark)
  find_package(PkgConfig QUIET)
  if(PKG_CONFIG_FOUND)
    pkg_check_modules(BULLET QUIET bullet)
  endif()
  if(BULLET_FOUND)
    target_compile_definitions(bench_step PRIVATE HAVE_BULLET)
    target_include_directories(bench_step SYSTEM PRIVATE ${BULLET_INCLUDE_DIRS})
    target_link_libraries(bench_step ${BULLET_LIBRARIES})
  endif()
endif()
