# Makes the Debian package, unpacks it, and works with what was in it.
# cmake -D BINARY_DIR=... -D VERSION=... -P deb.cmake
set(work "${BINARY_DIR}/package_deb")
set(root "${work}/root of it")
file(REMOVE_RECURSE "${work}")
file(MAKE_DIRECTORY "${root}")

function(run what)
  execute_process(COMMAND ${ARGN} OUTPUT_VARIABLE output ERROR_VARIABLE output RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "${what} failed (${result}):\n${output}")
  endif()
  message(STATUS "${what}: done")
  set(output "${output}" PARENT_SCOPE)
endfunction()

function(expect what text pattern)
  if(NOT text MATCHES "${pattern}")
    message(FATAL_ERROR "${what}: expected '${pattern}', found:\n${text}")
  endif()
endfunction()

run("cpack" cpack -G DEB --config "${BINARY_DIR}/CPackConfig.cmake" -B "${work}")
file(GLOB package "${work}/stemvo_${VERSION}_*.deb")
run("fields" dpkg-deb --field "${package}" Depends)
expect("dependencies" "${output}" "libopencv-core")
expect("dependencies" "${output}" "libyaml-cpp")
run("unpack" dpkg-deb --extract "${package}" "${root}")

set(program "${root}/usr/bin/stemvo")
run("program" "${program}" --version)
expect("version" "${output}" "${VERSION}")
run("libraries" ldd "${program}")
expect("ONNX Runtime of the package" "${output}" "root of it/usr/[^\n]*libonnxruntime")
run("render" "${program}" synth "${work}/drive" --frames 6 --width 320 --height 96)
run("odometry" "${program}" run "${work}/drive/sequences/00" --out "${work}/result")
expect("summary" "${output}" "report.html")

file(READ "${root}/usr/share/man/man1/stemvo.1" page)
expect("man page" "${page}" "\n.SH STEMVO MODELS\n")
set(ENV{PATH} "${root}/usr/bin:$ENV{PATH}")
file(WRITE "${work}/completions.sh" "source '${root}/usr/share/bash-completion/completions/stemvo'
try() { COMP_WORDS=(stemvo \"$@\"); COMP_CWORD=$#; _stemvo; echo \"[\${COMPREPLY[*]}]\"; }
try mo; try run --fr; try run x --set stem.mo\n")
run("completions" bash "${work}/completions.sh")
expect("commands" "${output}" "\\[models\\]\n\\[--frames\\]")
expect("keys" "${output}" "\\[stem.model=\\]\n$")
