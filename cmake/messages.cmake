# Messages, services, actions, the Python module and what the package exports. Included by CMakeLists.txt after catkin was found.
catkin_python_setup()  # before the messages, which come into the same Python module

file(GLOB message_files RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}/msg CONFIGURE_DEPENDS msg/*.msg)
file(GLOB service_files RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}/srv CONFIGURE_DEPENDS srv/*.srv)
add_message_files(FILES ${message_files})
file(GLOB action_files RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}/action CONFIGURE_DEPENDS action/*.action)
add_service_files(FILES ${service_files})
add_action_files(DIRECTORY action FILES ${action_files})
generate_messages(DEPENDENCIES actionlib_msgs geometry_msgs sensor_msgs shape_msgs std_msgs)

# The rviz plugin's library is for rviz alone.
#catkin_lint: ignore missing_export_lib
catkin_package(
  INCLUDE_DIRS include
  CATKIN_DEPENDS actionlib_msgs geometry_msgs message_runtime roscpp rosgraph_msgs sensor_msgs shape_msgs std_msgs std_srvs visualization_msgs)

install(DIRECTORY config launch
  DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
file(GLOB client_scripts RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS scripts/*.py)
if(client_scripts)
  #catkin_lint: ignore_once argument_error
  catkin_install_python(PROGRAMS ${client_scripts}
    DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endif()
