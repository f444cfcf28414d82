// SPDX-License-Identifier: MIT
#include "dataset/frame_files.hpp"

#include <system_error>

namespace stemvo::dataset {

namespace fs = std::filesystem;

bool is_folder(const fs::path& path) {
  std::error_code code;
  return fs::is_directory(path, code);
}

fs::path absolute_folder(const fs::path& folder) {
  std::error_code code;
  return (fs::absolute(folder, code) / "").lexically_normal().parent_path();
}

Expected<FrameRange> resolve_range(const std::optional<FrameRangeRequest>& request,
                                   std::size_t num_frames,
                                   const fs::path& folder) {
  if (!request) {
    return FrameRange{0, num_frames};
  }
  const FrameRange range{request->begin, request->end.value_or(num_frames)};
  if (range.begin >= range.end || range.end > num_frames) {
    const std::string end = request->end ? std::to_string(*request->end) : "";
    return fail(fmt::format("{}: expected frames inside 0:{}, found --frames {}:{}",
                            folder.string(), num_frames, request->begin, end));
  }
  return range;
}

bool has_center_inside(const Camera& camera) {
  return camera.cx_px > 0.0 && camera.cx_px < camera.width_px && camera.cy_px > 0.0 &&
         camera.cy_px < camera.height_px;
}

Status check_size(const fs::path& file, const cv::Mat& picture, const Camera& camera) {
  if (picture.cols != camera.width_px || picture.rows != camera.height_px) {
    return fail(fmt::format("{}: expected an image of {}x{} pixels, found {}x{}", file.string(),
                            camera.width_px, camera.height_px, picture.cols, picture.rows));
  }
  return {};
}

}  // namespace stemvo::dataset
