# Warnings and sanitizers as one target that is never exported.
option(STEMVO_WARNINGS_AS_ERRORS "Treat warnings as errors (set by the presets)" OFF)
option(STEMVO_SANITIZE "Address and undefined-behaviour sanitizers" OFF)
option(STEMVO_SANITIZE_THREAD "Thread sanitizer; of the tests only those of work in several threads are built" OFF)

add_library(stemvo_options INTERFACE)
target_compile_options(stemvo_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
                                                -Wold-style-cast -Woverloaded-virtual)
if(STEMVO_WARNINGS_AS_ERRORS)
  target_compile_options(stemvo_options INTERFACE -Werror)
endif()
if(STEMVO_SANITIZE)
  # GCC's manual: the sanitizers bring false positives of this one (std::regex is full of them).
  target_compile_options(stemvo_options INTERFACE -Wno-maybe-uninitialized)
  target_compile_options(stemvo_options INTERFACE -fsanitize=address,undefined
                                                  -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(stemvo_options INTERFACE -fsanitize=address,undefined)
endif()
if(STEMVO_SANITIZE_THREAD)
  target_compile_options(stemvo_options INTERFACE -fsanitize=thread -fno-omit-frame-pointer)
  target_link_options(stemvo_options INTERFACE -fsanitize=thread)
endif()

# What is shipped stops where memory is written beyond its end; measured to cost nothing (docs/performance.md).
function(stemvo_harden)
  if(NOT CMAKE_BUILD_TYPE STREQUAL "Release")
    return()
  endif()
  add_compile_options(-fstack-protector-strong -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=3 -fPIE)
  add_link_options(-pie -Wl,-z,relro,-z,now)
endfunction()

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND PROJECT_IS_TOP_LEVEL AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # ccache takes precompiled headers only where it need not mind their macros and times.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
endif()
