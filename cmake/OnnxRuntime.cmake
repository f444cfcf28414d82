# The target `stemvo_onnxruntime`: the shared library, and the official C header or our own in its
# place. The library comes from ONNXRUNTIME_ROOT (an unpacked release archive) if that is given,
# else from third_party/onnxruntime/lib, where `make build` puts the one of the PyPI wheel.
set(ONNXRUNTIME_ROOT "" CACHE PATH "Unpacked ONNX Runtime release archive (empty: third_party/onnxruntime)")

function(stemvo_find_onnxruntime own_dir)
  if(ONNXRUNTIME_ROOT)
    find_library(STEMVO_ONNXRUNTIME_LIBRARY NAMES onnxruntime libonnxruntime.so.1 PATHS "${ONNXRUNTIME_ROOT}"
                 PATH_SUFFIXES lib lib64 NO_DEFAULT_PATH NO_CACHE)
    if(NOT STEMVO_ONNXRUNTIME_LIBRARY)
      message(FATAL_ERROR "ONNXRUNTIME_ROOT=${ONNXRUNTIME_ROOT}: expected lib/libonnxruntime.so, found none")
    endif()
  else()
    set(STEMVO_ONNXRUNTIME_LIBRARY "${own_dir}/lib/libonnxruntime.so.1")
    if(NOT EXISTS "${STEMVO_ONNXRUNTIME_LIBRARY}")
      message(FATAL_ERROR "stemvo needs ONNX Runtime at ${STEMVO_ONNXRUNTIME_LIBRARY}: "
                          "run 'make build', or give ONNXRUNTIME_ROOT")
    endif()
  endif()

  # The wheel holds no header. The official one wins where there is one; ours declares the same
  # names at the same places of the append-only table, so no source file knows which it got.
  find_path(STEMVO_ONNXRUNTIME_INCLUDE onnxruntime_c_api.h
            HINTS "${ONNXRUNTIME_ROOT}" "$ENV{CONDA_PREFIX}"
            PATH_SUFFIXES include include/onnxruntime include/onnxruntime/core/session
                          onnxruntime onnxruntime/core/session NO_CACHE)
  if(NOT STEMVO_ONNXRUNTIME_INCLUDE)
    set(STEMVO_ONNXRUNTIME_INCLUDE "${own_dir}")
  endif()
  message(STATUS "ONNX Runtime: ${STEMVO_ONNXRUNTIME_LIBRARY}, header in ${STEMVO_ONNXRUNTIME_INCLUDE}")

  add_library(stemvo_onnxruntime SHARED IMPORTED GLOBAL)
  set_target_properties(
    stemvo_onnxruntime
    PROPERTIES IMPORTED_LOCATION "${STEMVO_ONNXRUNTIME_LIBRARY}"
               INTERFACE_INCLUDE_DIRECTORIES "${STEMVO_ONNXRUNTIME_INCLUDE}")
endfunction()

if(NOT TARGET stemvo_onnxruntime)
  cmake_path(SET own_onnxruntime NORMALIZE "${CMAKE_CURRENT_LIST_DIR}/../third_party/onnxruntime")
  stemvo_find_onnxruntime("${own_onnxruntime}")
endif()
