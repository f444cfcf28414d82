# `cmake --install`: the program, the library, what they need at run time, and packages for CMake and pkg-config.
#   bin/stemvo  lib/libstemvo.a (or .so)  lib/stemvo/{libonnxruntime.so.1,libstemvo_video.so,libstemvo_markers.so}  lib/{cmake/stemvo,pkgconfig}  include/stemvo
#   share/stemvo/config  share/doc/stemvo
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/stemvo)
set(runtime_dir ${CMAKE_INSTALL_LIBDIR}/stemvo)

install(DIRECTORY include/stemvo DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(DIRECTORY config DESTINATION share/stemvo)
install(FILES LICENSE DESTINATION share/doc/stemvo)

set(library stemvo)
if(BUILD_SHARED_LIBS)
  set(library stemvo_shared)
  set_target_properties(stemvo_shared PROPERTIES INSTALL_RPATH "$ORIGIN/stemvo")  # ONNX Runtime
endif()
install(TARGETS ${library} EXPORT stemvoTargets)
install(EXPORT stemvoTargets NAMESPACE stemvo:: DESTINATION ${package_dir})

if(TARGET stemvo_app)
  file(RELATIVE_PATH runtime_from_bin /prefix/${CMAKE_INSTALL_BINDIR} /prefix/${runtime_dir})
  set_target_properties(stemvo_app PROPERTIES INSTALL_RPATH "$ORIGIN/${runtime_from_bin}")
  install(TARGETS stemvo_app)
  install(TARGETS stemvo_video stemvo_markers LIBRARY DESTINATION ${runtime_dir})
  install(FILES third_party/plotly/LICENSE.txt DESTINATION share/doc/stemvo/plotly)  # which the program writes into reports
endif()

# ONNX Runtime under its own name, and a link for its SONAME: older releases carry the whole version
# in the SONAME, newer ones only the 1.
get_target_property(onnxruntime_library stemvo_onnxruntime IMPORTED_LOCATION)
file(REAL_PATH "${onnxruntime_library}" onnxruntime_library)
cmake_path(GET onnxruntime_library FILENAME onnxruntime_name)
install(FILES "${onnxruntime_library}" DESTINATION ${runtime_dir})
if(NOT onnxruntime_name STREQUAL "libonnxruntime.so.1")
  file(MAKE_DIRECTORY "${PROJECT_BINARY_DIR}/install")
  file(CREATE_LINK "${onnxruntime_name}" "${PROJECT_BINARY_DIR}/install/libonnxruntime.so.1" SYMBOLIC)
  install(FILES "${PROJECT_BINARY_DIR}/install/libonnxruntime.so.1" DESTINATION ${runtime_dir})
endif()
cmake_path(GET onnxruntime_library PARENT_PATH onnxruntime_dir)
install(FILES "${onnxruntime_dir}/LICENSE" "${onnxruntime_dir}/ThirdPartyNotices.txt"
        DESTINATION share/doc/stemvo/onnxruntime OPTIONAL)

configure_package_config_file(cmake/stemvoConfig.cmake.in ${PROJECT_BINARY_DIR}/install/stemvoConfig.cmake
                              INSTALL_DESTINATION ${package_dir} PATH_VARS runtime_dir NO_SET_AND_CHECK_MACRO)
# Below 1.0 a new minor version may break its users.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/install/stemvoConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/install/stemvoConfig.cmake
              ${PROJECT_BINARY_DIR}/install/stemvoConfigVersion.cmake DESTINATION ${package_dir})

cmake_path(RELATIVE_PATH CMAKE_INSTALL_PREFIX BASE_DIRECTORY ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig OUTPUT_VARIABLE prefix_from_pkgconfig)
get_target_property(opencv_include_dir opencv_core INTERFACE_INCLUDE_DIRECTORIES)
configure_file(cmake/stemvo.pc.in ${PROJECT_BINARY_DIR}/install/stemvo.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/install/stemvo.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
