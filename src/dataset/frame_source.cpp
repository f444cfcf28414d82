// SPDX-License-Identifier: MIT
#include "stemvo/dataset/frame_source.hpp"

#include <system_error>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "dataset/picture_folder.hpp"
#include "dataset/picture_list.hpp"
#include "stemvo/dataset/sequence.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

/// A folder with some of KITTI's layout: KittiSequence says what is missing.
bool looks_like_kitti(const fs::path& folder) {
  std::error_code code;
  for (const char* name : {"image_0", "image_1", "image_2", "image_3", "calib.txt", "times.txt"}) {
    if (fs::exists(folder / name, code)) {
      return true;
    }
  }
  return false;
}

/// No camera file is given.
Error refuse(const fs::path& path) {
  if (dataset::is_pattern(path)) {
    return fail(
        fmt::format("{}: expected --camera FILE beside a pattern, found none", path.string()));
  }
  if (!dataset::is_folder(path)) {
    return fail(
        fmt::format("{}: expected a folder in KITTI's layout, or of pictures with "
                    "--camera FILE, found none",
                    path.string()));
  }
  return fail(
      fmt::format("{}: expected KITTI's layout (image_2 or image_0, calib.txt, times.txt) "
                  "or, for pictures, --camera FILE, found neither",
                  path.string()));
}

template <typename Source>
Expected<std::unique_ptr<const FrameSource>> to_pointer(Expected<Source> source) {
  if (!source) {
    return source.error();
  }
  return std::make_unique<const Source>(std::move(*source));
}

}  // namespace

Expected<std::unique_ptr<const FrameSource>> open_source(const FrameSourceRequest& request) {
  if (request.camera_file) {
    if (request.calibration) {
      return fail(fmt::format("{}: expected --camera or --calib (KITTI's layout only), found both",
                              request.calibration->string()));
    }
    return to_pointer(dataset::PictureFolder::open(request));
  }
  if (request.times) {
    return fail(
        fmt::format("{}: expected --times beside --camera only (KITTI's layout has "
                    "times.txt), found no --camera",
                    request.times->string()));
  }
  if (!dataset::is_folder(request.path) || !looks_like_kitti(request.path)) {
    return refuse(request.path);
  }
  return to_pointer(KittiSequence::open(request.path, {request.kitti_camera, request.frames,
                                                       request.ground_truth, request.calibration}));
}

}  // namespace stemvo
