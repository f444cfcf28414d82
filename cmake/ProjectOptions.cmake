# Warnings and sanitizers as one target that is never exported.
option(STEMVO_WARNINGS_AS_ERRORS "Treat warnings as errors (set by the presets)" OFF)
option(STEMVO_SANITIZE "Address and undefined-behaviour sanitizers" OFF)
option(STEMVO_SANITIZE_THREAD "Thread sanitizer; of the tests only those of work in several threads are built" OFF)
option(STEMVO_FUZZ "Build tests/fuzz (clang's libFuzzer) beside the other tests" OFF)

add_library(stemvo_options INTERFACE)
target_compile_options(stemvo_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
                                                -Wold-style-cast -Woverloaded-virtual)
if(STEMVO_WARNINGS_AS_ERRORS)
  target_compile_options(stemvo_options INTERFACE -Werror)
endif()
if(STEMVO_FUZZ)
  # Counted branches for the fuzzer; a number that does not fit what it is cast to is an error too.
  target_compile_options(stemvo_options INTERFACE -fsanitize=fuzzer-no-link,float-cast-overflow)
endif()
if(STEMVO_SANITIZE)
  # GCC's manual: the sanitizers bring false positives of this one (std::regex is full of them).
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(stemvo_options INTERFACE -Wno-maybe-uninitialized)
  endif()
  target_compile_options(stemvo_options INTERFACE -fsanitize=address,undefined
                                                  -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(stemvo_options INTERFACE -fsanitize=address,undefined)
endif()
if(STEMVO_SANITIZE_THREAD)
  target_compile_options(stemvo_options INTERFACE -fsanitize=thread -fno-omit-frame-pointer)
  target_link_options(stemvo_options INTERFACE -fsanitize=thread)
endif()

# The shipped program stops where memory is written beyond its end (docs/reliability.md). Not for a project that includes
# this one.
if(PROJECT_IS_TOP_LEVEL)
  set(CMAKE_POSITION_INDEPENDENT_CODE ON)
  include(CheckPIESupported)
  check_pie_supported(LANGUAGES CXX)
  add_compile_options($<$<CONFIG:Release>:-fstack-protector-strong> $<$<CONFIG:Release>:-fno-semantic-interposition>
                      $<$<CONFIG:Release>:-U_FORTIFY_SOURCE> $<$<CONFIG:Release>:-D_FORTIFY_SOURCE=3>)
  add_link_options($<$<CONFIG:Release>:-Wl,-z,relro,-z,now>)
endif()

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM AND PROJECT_IS_TOP_LEVEL AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # ccache takes precompiled headers only where it need not mind their macros and times. Paths from the build folder: what build/release
  # compiled is not compiled again for the Python package, whose library has the same flags.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} ${CCACHE_PROGRAM})
endif()
