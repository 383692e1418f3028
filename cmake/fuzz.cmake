# libFuzzer targets (scripts/fuzz): with clang, on top of a build of the core that is instrumented for them.
file(GLOB fuzz_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/test/fuzz/*.cpp)
foreach(source IN LISTS fuzz_sources)
  get_filename_component(fuzz_name ${source} NAME_WE)
  add_executable(fuzz_${fuzz_name} ${source})
  target_include_directories(fuzz_${fuzz_name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/test ${CMAKE_CURRENT_SOURCE_DIR}/src)
  target_compile_definitions(fuzz_${fuzz_name} PRIVATE SOURCE_DIR="${CMAKE_CURRENT_SOURCE_DIR}")
  target_link_libraries(fuzz_${fuzz_name} ${PROJECT_NAME}_io -fsanitize=fuzzer)
endforeach()
