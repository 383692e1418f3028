# The ROS side of the build: what the node links, what is installed, and the rostests. Included by CMakeLists.txt after
# the node's target.

find_package(roslib REQUIRED)
target_include_directories(${PROJECT_NAME}_ros SYSTEM PRIVATE ${roslib_INCLUDE_DIRS})
target_link_libraries(${PROJECT_NAME}_ros PRIVATE ${roslib_LIBRARIES})

find_package(utf8cpp REQUIRED)  # headers alone
target_link_libraries(${PROJECT_NAME}_ros PRIVATE utf8cpp)

target_compile_definitions(${PROJECT_NAME}_ros PRIVATE MESHLESS_SURGERY_VERSION="${${PROJECT_NAME}_VERSION}")

target_include_directories(deformer_node PRIVATE include)
target_include_directories(review_node PRIVATE include)

# --- install
# scripts/train and scripts/check are for a checkout; tests and clients are installed by catkin_install_python below.
#catkin_lint: ignore uninstalled_script
# The linter does not look into add_room().
#catkin_lint: ignore_once undefined_target
install(TARGETS ${PROJECT_NAME}_ros
  ARCHIVE DESTINATION ${MESHLESS_SURGERY_LIBRARY_FOLDER}
  LIBRARY DESTINATION ${MESHLESS_SURGERY_LIBRARY_FOLDER}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION})
set(programs deformer_node review_node drive make_meshes replay report ${bench_targets})
# Programs find the libraries of their own installation, wherever that lies, as the libraries find each other.
file(RELATIVE_PATH to_libraries /${CATKIN_PACKAGE_BIN_DESTINATION} /${MESHLESS_SURGERY_LIBRARY_FOLDER})
string(REGEX REPLACE "/$" "" to_libraries "$ORIGIN/${to_libraries}")
set_target_properties(${programs} PROPERTIES INSTALL_RPATH ${to_libraries})
set_target_properties(${PROJECT_NAME}_ros PROPERTIES INSTALL_RPATH "$ORIGIN")
install(TARGETS ${programs}
  RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
install(DIRECTORY bench/truth/data bench/truth/calculix
  DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}/bench/truth)
install(DIRECTORY bench/measured
  DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}/bench)
# Where programs of the devel space look for them, too.
set(devel_share ${CATKIN_DEVEL_PREFIX}/share/${PROJECT_NAME})
file(MAKE_DIRECTORY ${devel_share}/bench/truth)
file(CREATE_LINK ${CMAKE_CURRENT_SOURCE_DIR}/config ${devel_share}/config SYMBOLIC)
file(CREATE_LINK ${CMAKE_CURRENT_SOURCE_DIR}/bench/truth/data ${devel_share}/bench/truth/data SYMBOLIC)
file(CREATE_LINK ${CMAKE_CURRENT_SOURCE_DIR}/bench/measured ${devel_share}/bench/measured SYMBOLIC)
