# Writes build/<preset>/generated/stemvo_build_version.hpp at every build, so that the commit in it is
# the one that was compiled; the file changes (and version.cpp recompiles) only when the commit does.
# Used twice: included by CMakeLists.txt it makes the target, run as a script it writes the file.
if(NOT CMAKE_SCRIPT_MODE_FILE)
  find_package(Git QUIET)
  set(command ${CMAKE_COMMAND} -D "GIT=${GIT_EXECUTABLE}" -D "SOURCE=${PROJECT_SOURCE_DIR}"
      -D "VERSION=${PROJECT_VERSION}" -D "OUT=${PROJECT_BINARY_DIR}/generated/stemvo_build_version.hpp"
      -P ${CMAKE_CURRENT_LIST_FILE})
  add_custom_target(stemvo_version COMMAND ${command}
                    BYPRODUCTS ${PROJECT_BINARY_DIR}/generated/stemvo_build_version.hpp
                    COMMENT "Looking up the commit" VERBATIM)
  return()
endif()

set(text "${VERSION}")
if(GIT AND EXISTS "${SOURCE}/.git") # an unpacked archive inside another repository has no commit of its own
  execute_process(COMMAND "${GIT}" -C "${SOURCE}" describe --always --exclude=* --abbrev=12 --dirty=.dirty
                  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
  if(NOT failed)
    string(APPEND text "+${commit}")
  endif()
endif()
file(CONFIGURE OUTPUT "${OUT}" @ONLY CONTENT [[
// SPDX-License-Identifier: MIT
#pragma once

#include <string_view>

namespace stemvo::internal {

inline constexpr std::string_view kBuildVersion = "@text@";

}  // namespace stemvo::internal
]])
