# Installs into BINARY_DIR/package, moves the installed tree (it must not know where it was made), and
# builds and runs the examples against it, on frames of a rendered drive.
# cmake -D BINARY_DIR=... -D VERSION=... -P install_and_consume.cmake
set(work "${BINARY_DIR}/package")
set(prefix "${work}/moved prefix")
file(REMOVE_RECURSE "${work}")

function(run what)
  execute_process(COMMAND ${ARGN} OUTPUT_VARIABLE output ERROR_VARIABLE output RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "${what} failed (${result}):\n${output}")
  endif()
  message(STATUS "${what}: done")
  set(output "${output}" PARENT_SCOPE)
endfunction()

run("install" ${CMAKE_COMMAND} --install "${BINARY_DIR}" --prefix "${work}/staged")
file(RENAME "${work}/staged" "${prefix}")

run("installed program" "${prefix}/bin/stemvo" --version)
if(NOT output MATCHES "${VERSION}")
  message(FATAL_ERROR "stemvo --version: expected ${VERSION}, found '${output}'")
endif()
run("installed models" "${prefix}/bin/stemvo" models)

cmake_path(GET CMAKE_CURRENT_LIST_DIR PARENT_PATH tests)
set(examples "${tests}/../examples")
# README shows the example, without the licence line.
file(READ "${tests}/../README.md" readme)
file(READ "${examples}/images_to_poses.cpp" example)
string(REPLACE "// SPDX-License-Identifier: MIT\n" "```cpp\n" example "${example}")
string(FIND "${readme}" "${example}```" at)
if(at EQUAL -1)
  message(FATAL_ERROR "README.md: expected the program of examples/images_to_poses.cpp in a block of cpp, found another or none")
endif()

file(GLOB_RECURSE headers RELATIVE "${prefix}/include" "${prefix}/include/stemvo/*.hpp")
list(LENGTH headers count)
if(count GREATER 12)
  message(FATAL_ERROR "expected at most 12 public headers, found ${count}")
endif()
list(TRANSFORM headers REPLACE "(.+)" "#include <\\1>\n")
list(JOIN headers "" all_headers)
file(WRITE "${work}/all_headers.cpp" "${all_headers}")

# Makefiles, because they leave the files that list each object's includes.
run("configure" ${CMAKE_COMMAND} -S "${CMAKE_CURRENT_LIST_DIR}" -B "${work}/build" -G "Unix Makefiles"
    -D CMAKE_BUILD_TYPE=Release -D "CMAKE_PREFIX_PATH=${prefix}" -D "STEMVO_ALL_HEADERS=${work}/all_headers.cpp")
run("build" ${CMAKE_COMMAND} --build "${work}/build" --parallel 2)
run("configure the examples" ${CMAKE_COMMAND} -S "${examples}" -B "${work}/examples" -G "Unix Makefiles" -D CMAKE_BUILD_TYPE=Release
    "-D CMAKE_PREFIX_PATH=${prefix}")
run("build the examples" ${CMAKE_COMMAND} --build "${work}/examples" --parallel 2)
run("render" "${BINARY_DIR}/stemvo" synth "${work}/drive" --frames 4)
file(GLOB frames "${work}/drive/sequences/00/image_2/*.png")
list(SORT frames)
run("images_to_poses" "${work}/examples/images_to_poses" ${frames})
set(positions_by_cmake "${output}")
string(REGEX MATCHALL "[^\n]+\n" positions "${output}")
list(LENGTH positions count)
list(GET positions 3 last)
# x right, y down, z forward: a car drives some metres forward.
if(NOT count EQUAL 4 OR NOT last MATCHES " ([0-9.]+)\n$" OR CMAKE_MATCH_1 LESS 1 OR CMAKE_MATCH_1 GREATER 10)
  message(FATAL_ERROR "images_to_poses: expected 4 positions, the last 1 to 10 m ahead, found:\n${output}")
endif()

# The same program by README's command, whose output of pkg-config the shell splits at spaces.
file(CREATE_LINK "${prefix}" "${work}/prefix" SYMBOLIC)
set(ENV{PKG_CONFIG_PATH} "${work}/prefix/lib/pkgconfig")
if(NOT readme MATCHES "`(g\\+\\+ [^`]+pkg-config[^`]+)`")
  message(FATAL_ERROR "README.md: expected a command with pkg-config, found none")
endif()
set(command "${CMAKE_MATCH_1}")
file(COPY_FILE "${examples}/images_to_poses.cpp" "${work}/main.cpp")
run("compile with pkg-config" ${CMAKE_COMMAND} -E chdir "${work}" sh -c "${command}")
run("images_to_poses by pkg-config" "${work}/poses" ${frames})
if(NOT output STREQUAL positions_by_cmake)
  message(FATAL_ERROR "pkg-config: expected the same positions, found:\n${output}")
endif()

# The same frames as raw gray pixels.
run("raw frames" "${tests}/../build/venv/bin/python" -c
    "import sys\nfrom PIL import Image\nopen(sys.argv[1], 'wb').write(b''.join(Image.open(f).convert('L').tobytes() for f in sys.argv[2:]))"
    "${work}/frames.raw" ${frames})
run("own_source" "${work}/examples/own_source" 1241 376 718.86 718.86 607.19 185.22 10 INPUT_FILE "${work}/frames.raw")
if(NOT output MATCHES "^0 first +0 +0 +0\n0.1 [a-z_]+ [^\n]+\n0.2 [a-z_]+ [^\n]+\n0.3 [a-z_]+ [^\n]+\n$")
  message(FATAL_ERROR "own_source: expected 4 times, states and positions, found:\n${output}")
endif()

# Points 4 to 10 m away; the camera goes 0.5 m to the right: the points to the left.
set(matches "")
foreach(i RANGE 79)
  math(EXPR u "(${i} * 53) % 600 + 20")
  math(EXPR v "(${i} * 37) % 440 + 20")
  math(EXPR shift "25 + (${i} * 7) % 38")
  math(EXPR moved "${u} - ${shift}")
  string(APPEND matches "${u} ${v} ${moved} ${v}\n")
endforeach()
file(WRITE "${work}/matches.txt" "${matches}")
run("two_view" "${work}/examples/two_view" 640 480 500 500 320 240 INPUT_FILE "${work}/matches.txt")
if(NOT output MATCHES "^tracking\n *1 [^\n]* -1\n")
  message(FATAL_ERROR "two_view: expected no rotation and x of the second camera from the first of -1, found:\n${output}")
endif()

file(GLOB_RECURSE dependency_files "${work}/build/*.o.d" "${work}/examples/*.o.d")
list(LENGTH dependency_files count)
file(GLOB example_files "${examples}/*.cpp")
list(LENGTH example_files expected)
math(EXPR expected "${expected} + 2")
if(NOT count EQUAL expected)
  message(FATAL_ERROR "expected the include lists of ${expected} objects, found ${count}")
endif()
foreach(file IN LISTS dependency_files)
  file(READ "${file}" includes)
  if(includes MATCHES "[^ \n]*/(onnxruntime[^/ ]*|ceres|yaml-cpp|openssl|nlohmann|fmt|tl)[/.][^ \n]*")
    message(FATAL_ERROR "a public header includes a hidden library: ${CMAKE_MATCH_0} (${file})")
  endif()
endforeach()
