# Installs into BINARY_DIR/package, moves the installed tree (it must not know where it was made), and
# builds and runs the consumer beside this file against it.
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

file(GLOB_RECURSE headers RELATIVE "${prefix}/include" "${prefix}/include/stemvo/*.hpp")
list(TRANSFORM headers REPLACE "(.+)" "#include <\\1>\n")
list(JOIN headers "" all_headers)
file(WRITE "${work}/all_headers.cpp" "${all_headers}")

# Makefiles, because they leave the files that list each object's includes.
run("configure" ${CMAKE_COMMAND} -S "${CMAKE_CURRENT_LIST_DIR}" -B "${work}/build" -G "Unix Makefiles"
    -D CMAKE_BUILD_TYPE=Release -D "CMAKE_PREFIX_PATH=${prefix}" -D "STEMVO_ALL_HEADERS=${work}/all_headers.cpp")
run("build" ${CMAKE_COMMAND} --build "${work}/build" --parallel 2)
run("run" "${work}/build/consumer" "${prefix}/share/stemvo/models")
if(NOT output MATCHES "^${VERSION}[^ ]*: first\n$")
  message(FATAL_ERROR "consumer: expected '${VERSION}...: first', found '${output}'")
endif()

file(GLOB_RECURSE dependency_files "${work}/build/*.o.d")
list(LENGTH dependency_files count)
if(NOT count EQUAL 3)
  message(FATAL_ERROR "expected the include lists of 3 objects, found ${count}")
endif()
foreach(file IN LISTS dependency_files)
  file(READ "${file}" includes)
  if(includes MATCHES "[^ \n]*/(onnxruntime[^/ ]*|ceres|yaml-cpp|cairo[^/ ]*|openssl|nlohmann|fmt)[/.][^ \n]*")
    message(FATAL_ERROR "a public header includes a hidden library: ${CMAKE_MATCH_0} (${file})")
  endif()
endforeach()
