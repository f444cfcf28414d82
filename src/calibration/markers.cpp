// SPDX-License-Identifier: MIT
#include "calibration/markers.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include "io/loaded_module.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

/// The module does not name OpenCV's library, so that the package does not ask for it.
Expected<FindMarkers*> load_markers() {
  if (::dlopen(STEMVO_MARKER_LIBRARY, RTLD_NOW | RTLD_GLOBAL) == nullptr) {
    return fail(fmt::format(
        "{}: expected OpenCV's library that finds markers (Debian: libopencv-contrib4xx or "
        "libopencv-objdetect4xx), found none: {}",
        STEMVO_MARKER_LIBRARY, ::dlerror()));
  }
  return io::load_symbol("libstemvo_markers.so", kFindMarkers, "finds markers")
      .map([](void* symbol) { return reinterpret_cast<FindMarkers*>(symbol); });
}

}  // namespace

Expected<std::vector<Marker>> find_markers(const cv::Mat& gray, const std::string& dictionary) {
  static const Expected<FindMarkers*> loaded = load_markers();
  STEMVO_TRY_GET(FindMarkers* const find, loaded);
  std::vector<Marker> markers;
  if (!find(gray, dictionary.c_str(), markers)) {
    return fail(fmt::format(
        "--board: expected a dictionary from DICT_4X4_50 to DICT_APRILTAG_36h11, found '{}'",
        dictionary));
  }
  return markers;
}

}  // namespace stemvo
