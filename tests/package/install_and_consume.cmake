# Installs into BINARY_DIR/package, moves the installed tree (it must not know where it was made), and
# builds and runs the program of the README against it, on frames of a rendered drive.
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
file(READ "${tests}/../README.md" readme)
if(NOT readme MATCHES "```cpp\n([^`]+)```")
  message(FATAL_ERROR "README.md: expected a program in a block of cpp, found none")
endif()
file(WRITE "${work}/readme_program.cpp" "${CMAKE_MATCH_1}")

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
    -D CMAKE_BUILD_TYPE=Release -D "CMAKE_PREFIX_PATH=${prefix}" -D "STEMVO_ALL_HEADERS=${work}/all_headers.cpp"
    -D "STEMVO_README_PROGRAM=${work}/readme_program.cpp")
run("build" ${CMAKE_COMMAND} --build "${work}/build" --parallel 2)
run("render" "${BINARY_DIR}/stemvo" synth "${work}/drive" --frames 4)
file(GLOB frames "${work}/drive/sequences/00/image_2/*.png")
list(SORT frames)
run("run" "${work}/build/consumer" ${frames})
string(REGEX MATCHALL "[^\n]+\n" positions "${output}")
list(LENGTH positions count)
list(GET positions 3 last)
# x right, y down, z forward: a car drives some metres forward.
if(NOT count EQUAL 4 OR NOT last MATCHES " ([0-9.]+)\n$" OR CMAKE_MATCH_1 LESS 1 OR CMAKE_MATCH_1 GREATER 10)
  message(FATAL_ERROR "README's program: expected 4 positions, the last 1 to 10 m ahead, found:\n${output}")
endif()

file(GLOB_RECURSE dependency_files "${work}/build/*.o.d")
list(LENGTH dependency_files count)
if(NOT count EQUAL 3)
  message(FATAL_ERROR "expected the include lists of 3 objects, found ${count}")
endif()
foreach(file IN LISTS dependency_files)
  file(READ "${file}" includes)
  if(includes MATCHES "[^ \n]*/(onnxruntime[^/ ]*|ceres|yaml-cpp|cairo[^/ ]*|openssl|nlohmann|fmt|tl)[/.][^ \n]*")
    message(FATAL_ERROR "a public header includes a hidden library: ${CMAKE_MATCH_0} (${file})")
  endif()
endforeach()
