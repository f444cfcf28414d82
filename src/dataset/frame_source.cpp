// SPDX-License-Identifier: MIT
#include "dataset/frame_source.hpp"

#include <system_error>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "dataset/image_list.hpp"
#include "dataset/sequence.hpp"
#include "internal_check.hpp"
#include "text/text_file.hpp"

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
  std::string_view problem =
      "expected KITTI's layout (image_2 or image_0, calib.txt, times.txt) or, for images, --camera "
      "FILE, found neither";
  if (dataset::is_pattern(path)) {
    problem = "expected --camera FILE beside a pattern, found none";
  } else if (!dataset::is_folder(path)) {
    problem = "expected a folder in KITTI's layout, or of images with --camera FILE, found none";
  }
  return fail(fmt::format("{}: {}", path.string(), problem));
}

}  // namespace

Expected<cv::Mat> FrameSource::read(std::size_t index) const {
  STEMVO_CHECK(index < size(), "frame index inside the range");
  return frames_.read(index);
}

Expected<FrameRangeRequest> parse_frame_range(const std::string& text) {
  const std::size_t colon = text.find(':');
  const std::string first = text.substr(0, colon);
  const std::string last = colon == std::string::npos ? "" : text.substr(colon + 1);
  const std::optional<std::size_t> begin = parse_index(first.empty() ? "0" : first);
  const std::optional<std::size_t> end = parse_index(last);
  if (colon == std::string::npos || text.size() == 1 || !begin || (!last.empty() && !end)) {
    return fail(fmt::format("expected A:B, A: or :B with whole numbers, found '{}'", text));
  }
  if (end && *end <= *begin) {
    return fail(fmt::format("expected A < B in the half-open A:B, found '{}'", text));
  }
  return FrameRangeRequest{*begin, end};
}

Expected<FrameSource> open_source(const FrameSourceRequest& request) {
  if (request.camera_file) {
    if (request.calibration) {
      return fail(fmt::format("{}: expected --camera or --calib (KITTI's layout only), found both",
                              request.calibration->string()));
    }
    return dataset::open_image_folder(request);
  }
  if (request.times) {
    return fail(
        fmt::format("{}: expected --times beside --camera only (KITTI's layout has "
                    "times.txt), found no --camera",
                    request.times->string()));
  }
  if (!dataset::is_folder(request.sequence_dir) || !looks_like_kitti(request.sequence_dir)) {
    return refuse(request.sequence_dir);
  }
  return KittiSequence::open(request.sequence_dir, request).map([](const FrameSource& source) {
    return source;
  });
}

}  // namespace stemvo
