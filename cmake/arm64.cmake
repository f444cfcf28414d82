# SPDX-License-Identifier: MIT
# Toolchain for 64-bit ARM on another machine: Debian's cross compiler, the libraries of the root that tools/arm64.sh unpacks,
# and an emulator for what runs while building and testing.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
cmake_path(SET STEMVO_ARM64_ROOT NORMALIZE "${CMAKE_CURRENT_LIST_DIR}/../build/arm64-root")
set(CMAKE_SYSROOT "${STEMVO_ARM64_ROOT}")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} "${STEMVO_ARM64_ROOT}")
set(ENV{PKG_CONFIG_LIBDIR}
    "${STEMVO_ARM64_ROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${STEMVO_ARM64_ROOT}/usr/share/pkgconfig")
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64 -cpu cortex-a72 -L "${STEMVO_ARM64_ROOT}")
