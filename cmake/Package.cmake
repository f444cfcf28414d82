# `cpack -G DEB` in the build folder: one package with the program, the library, its headers, a man page and
# completions for bash, zsh and fish. Its dependencies are those of the files in it (dpkg-shlibdeps).
if(TARGET stemvo_app)
  set(man_page ${PROJECT_BINARY_DIR}/install/stemvo.1)
  install(CODE "execute_process(COMMAND ${CMAKE_COMMAND} -D PROGRAM=$<TARGET_FILE:stemvo_app> -D OUT=${man_page}
                                        -D \"EMULATOR=${CMAKE_CROSSCOMPILING_EMULATOR}\"
                                        -P ${PROJECT_SOURCE_DIR}/cmake/package/man_page.cmake
                                COMMAND_ERROR_IS_FATAL ANY)")
  install(FILES ${man_page} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  install(FILES cmake/package/completions.bash DESTINATION share/bash-completion/completions RENAME stemvo)
  install(FILES cmake/package/completions.zsh DESTINATION share/zsh/vendor-completions RENAME _stemvo)
  install(FILES cmake/package/completions.fish DESTINATION share/fish/vendor_completions.d RENAME stemvo.fish)
endif()

install(FILES cmake/package/copyright DESTINATION share/doc/stemvo)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "stemvo's authors")
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# ONNX Runtime is in the package, in a folder of the package's own.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${onnxruntime_dir})
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "libopencv-contrib406 | libopencv-objdetect410, cmake, libopencv-dev, libeigen3-dev, libceres-dev, libfmt-dev, libssl-dev")
include(CPack)
