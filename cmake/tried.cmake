# What tests, benchmarks and the programs `drive` and `make_meshes` try the rooms with: generated shapes, and random scenes
# with their laws. No part of the library.
function(add_tried name)
  file(GLOB tried_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/test/${name}/*.cpp)
  list(FILTER tried_sources EXCLUDE REGEX "_(test|main)\\.cpp$")
  add_library(tried_${name} STATIC EXCLUDE_FROM_ALL ${tried_sources})
  target_include_directories(tried_${name} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/test)
  target_compile_options(tried_${name} PRIVATE -Wall -Wextra -Wpedantic)
  target_link_libraries(tried_${name} PUBLIC ${ARGN})
endfunction()

add_tried(shapes ${PROJECT_NAME}_geometry)
add_tried(drive tried_shapes ${PROJECT_NAME}_io)
