// SPDX-License-Identifier: MIT
#include "dataset/video_decoder.hpp"

#include <array>
#include <string>
#include <system_error>

#include <dlfcn.h>
#include <fmt/format.h>

namespace stemvo::dataset {

namespace fs = std::filesystem;

Expected<void*> load_symbol(const fs::path& built, const char* symbol, std::string_view what) {
  std::error_code code;
  const fs::path program = fs::read_symlink("/proc/self/exe", code);
  const std::array<fs::path, 2> places = {
      program.parent_path() / STEMVO_RUNTIME_FROM_BIN / built.filename(), built};  // installed
  std::string why;
  for (const fs::path& place : places) {
    // Never unloaded: decoders live as long as their videos.
    void* const module = ::dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (void* const found = module != nullptr ? ::dlsym(module, symbol) : nullptr) {
      return found;
    }
    why += fmt::format("; {}", ::dlerror());
  }
  return fail(
      fmt::format("{}: expected the module that {} beside the program, found none that loads{}",
                  places.front().lexically_normal().string(), what, why));
}

namespace {

Expected<std::unique_ptr<VideoDecoder>> open(const char* file, int number, const cv::Size& size) {
  static const Expected<void*> found =
      load_symbol(STEMVO_VIDEO_MODULE, kOpenDecoder, "decodes videos");
  return found.map([&](void* open_decoder) {
    return std::unique_ptr<VideoDecoder>(
        reinterpret_cast<OpenDecoder*>(open_decoder)(file, number, size.width, size.height));
  });
}

}  // namespace

Expected<std::unique_ptr<VideoDecoder>> decode_file(const std::string& file, const cv::Size& size) {
  return open(file.c_str(), 0, size);
}

Expected<std::unique_ptr<VideoDecoder>> decode_camera(int number, const cv::Size& size) {
  return open(nullptr, number, size);
}

}  // namespace stemvo::dataset
