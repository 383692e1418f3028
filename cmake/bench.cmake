# Benchmarks: executables without ROS. Built where their libraries are; a source file bench/<name>.cpp with a line below.
find_package(benchmark QUIET)
set(bench_targets)

function(add_bench name)
  add_executable(${name} ${ARGN})
  target_include_directories(${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/src)
  target_compile_options(${name} PRIVATE -Wall -Wextra -Wpedantic)
  target_link_libraries(${name} ${PROJECT_NAME}_world tried_shapes Threads::Threads)
  set(bench_targets ${bench_targets} ${name} PARENT_SCOPE)
endfunction()

# What benchmarks share with each other and with tests; built where one of them is.
function(add_bench_support name)
  add_library(${name} STATIC EXCLUDE_FROM_ALL ${ARGN})
  target_compile_options(${name} PRIVATE -Wall -Wextra -Wpedantic)
  target_include_directories(${name} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/bench ${CMAKE_CURRENT_SOURCE_DIR}/src)
  target_link_libraries(${name} PUBLIC ${PROJECT_NAME}_world tried_shapes)
endfunction()

add_bench_support(bench_truth bench/static_load.cpp bench/settled_load.cpp bench/tool_load.cpp bench/truth_case.cpp
  bench/truth_samples.cpp bench/truth_surface.cpp bench/laws.cpp bench/measured.cpp bench/truth_cube.cpp)
target_compile_definitions(bench_truth PUBLIC TRUTH_FOLDER="${CMAKE_CURRENT_SOURCE_DIR}/bench/truth/data"
  MEASURED_FOLDER="${CMAKE_CURRENT_SOURCE_DIR}/bench/measured"
  CALCULIX_FOLDER="${CMAKE_CURRENT_SOURCE_DIR}/bench/truth/calculix"
  MATERIALS_FOLDER="${CMAKE_CURRENT_SOURCE_DIR}/config/materials")
add_bench_support(bench_pile bench/contact_pile.cpp)
add_bench_support(bench_clip bench/cut_cgal_clip.cpp)
target_link_libraries(bench_clip PRIVATE CGAL::CGAL)

if(MESHLESS_SURGERY_SANITIZE)  # the core and its tests alone
  return()
endif()

add_bench(accuracy bench/accuracy.cpp bench/plot.cpp)
target_link_libraries(accuracy bench_truth CLI11::CLI11)
add_bench(measured bench/measured_main.cpp)
if(MESHLESS_SURGERY_CORE_ONLY)
  target_compile_definitions(measured PRIVATE OF_CHECKOUT)
endif()
target_link_libraries(measured bench_truth ${PROJECT_NAME}_io CLI11::CLI11)
add_bench(surfaces bench/surfaces.cpp)
target_link_libraries(surfaces tried_drive CLI11::CLI11)
add_bench(scaling bench/scaling.cpp bench/scaling_scenes.cpp bench/elastic_cost.cpp bench/machine_limits.cpp
  bench/contact_pieces.cpp bench/plot.cpp)
target_link_libraries(scaling CLI11::CLI11)
if(benchmark_FOUND)
  add_bench(bench_rotation bench/bench_rotation.cpp)
  target_link_libraries(bench_rotation benchmark::benchmark)
  add_bench(bench_step bench/bench_step.cpp bench/step_rows.cpp bench/step_pile.cpp bench/step_cells.cpp
    bench/step_liver.cpp bench/step_world.cpp)
  target_link_libraries(bench_step benchmark::benchmark)
  add_bench(bench_cut bench/bench_cut.cpp)
  target_link_libraries(bench_cut bench_clip benchmark::benchmark)
  add_bench(bench_incise bench/bench_incise.cpp)
  target_link_libraries(bench_incise benchmark::benchmark)
  add_bench(bench_contact bench/bench_contact.cpp bench/contact_after_cut.cpp bench/contact_pieces.cpp
    bench/plot.cpp)
  target_link_libraries(bench_contact bench_pile benchmark::benchmark)
  find_package(PkgConfig QUIET)
  if(PKG_CONFIG_FOUND)
    pkg_check_modules(BULLET QUIET bullet)
  endif()
  if(BULLET_FOUND)
    target_sources(bench_contact PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/bench/contact_bullet.cpp)
    foreach(target bench_step bench_contact)
      target_compile_definitions(${target} PRIVATE HAVE_BULLET)
      target_include_directories(${target} SYSTEM PRIVATE ${BULLET_INCLUDE_DIRS})
      target_link_libraries(${target} ${BULLET_LIBRARIES})
    endforeach()
  endif()
endif()
