// SPDX-License-Identifier: MIT
#include "dataset/frame_source.hpp"

#include <algorithm>
#include <regex>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

/// A file or folder that `python -m stemvo.bag` reads.
bool is_bag(const fs::path& path) {
  const fs::path kind = path.extension();
  return is_file(path) ? kind == ".bag" || kind == ".mcap" || kind == ".db3"
                       : is_file(path / "metadata.yaml");
}

Error refuse(const fs::path& path) {
  std::string problem =
      "expected KITTI's layout (image_2 or image_0, calib.txt, times.txt), EuRoC's (mav0/cam0), "
      "TUM's (rgb.txt) or images, found none of them; 'stemvo run --help' shows each";
  if (dataset::is_pattern(path) || dataset::list_images(path)) {
    problem =
        "images: expected --camera FILE, or camera.yaml in their folder, found neither; "
        "'stemvo run --help' shows what it holds";
  } else if (is_folder(path / "sequences")) {
    problem = "expected one recording, found a folder of them; give one, as sequences/00 in it";
  } else if (dataset::is_image_file(path)) {
    problem = "expected a recording, found one image; give its folder, or a quoted pattern";
  } else if (is_bag(path)) {
    problem =
        "expected a recording, found a ROS bag; 'python -m stemvo.bag BAG FOLDER' makes one of it";
  } else if (!is_folder(path)) {
    problem = fmt::format(
        "expected a folder, a video file, a quoted pattern of images or camera:N, found {}; check "
        "the path ('stemvo run --help' lists what is read)",
        kind_of(path));
  }
  return fail(fmt::format("{}: {}", path.string(), problem));
}

std::optional<Expected<dataset::Listing>> find_listing(const FrameSourceRequest& request) {
  const fs::path& path = request.sequence_dir;
  auto found = dataset::find_listing(path);
  const bool may_hold_images = is_folder(path) || dataset::is_pattern(path);
  if (found || !request.camera_file || !may_hold_images) {
    return found;
  }
  auto images = dataset::list_images(path);
  if (!images && looks_like_kitti(path)) {
    return fail(
        fmt::format("{}: KITTI's layout: expected no --camera, or --calib in its place, found {}",
                    path.string(), request.camera_file->string()));
  }
  return images;
}

Status check_unused(const FrameSourceRequest& request, bool is_listing, bool is_stream) {
  if (request.calibration && (is_listing || is_stream)) {
    return fail(fmt::format(
        "{}: expected --camera or --calib, which is for KITTI's layout only, found it with {}",
        request.calibration->string(), request.sequence_dir.string()));
  }
  if (request.times && !is_listing) {
    return fail(
        fmt::format("{}: expected --times beside --camera only, with images (KITTI's layout has "
                    "times.txt, a video its own), found {}",
                    request.times->string(), request.sequence_dir.string()));
  }
  if (request.rate_hz && !(*request.rate_hz >= 1e-6 && *request.rate_hz <= 1e5)) {
    return fail(
        fmt::format("--rate: expected a number from 1e-06 to 100000, found {}", *request.rate_hz));
  }
  if (request.rate_hz && !is_listing && !is_stream) {
    return fail(fmt::format("--rate {}: expected frames without times, found {}", *request.rate_hz,
                            request.sequence_dir.string()));
  }
  return {};
}

}  // namespace

Expected<FrameRangeRequest> parse_frame_range(const std::string& text) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const std::string first = text.substr(0, colon);
  const std::string last = text.substr(std::min(colon + 1, text.size()));
  const std::optional<std::size_t> begin = first.empty() ? 0 : to_number<std::size_t>(first);
  const std::optional<std::size_t> end = to_number<std::size_t>(last);
  if (colon == text.size() || text == ":" || !begin || (!last.empty() && !end)) {
    return fail(fmt::format("expected A:B, A: or :B with whole numbers, found '{}'", text));
  }
  if (end && *end <= *begin) {
    return fail(fmt::format("expected A < B in the half-open A:B, found '{}'", text));
  }
  return FrameRangeRequest{*begin, end};
}

Expected<std::optional<GroundTruth>> FrameSource::ground_truth_of(std::size_t num_frames) const {
  if (match) {
    std::vector<double> times_s;
    for (std::size_t i = 0; i < num_frames; ++i) {
      times_s.push_back(time_s(i));
    }
    return match(times_s).map([](const GroundTruth& truth) { return std::optional(truth); });
  }
  std::optional<GroundTruth> truth = ground_truth;
  if (truth) {
    truth->frames.erase(std::ranges::lower_bound(truth->frames, num_frames), truth->frames.end());
    truth->poses.resize(truth->frames.size());
  }
  return truth;
}

std::vector<std::string> FrameSource::warnings_so_far() const {
  std::vector<std::string> all = warnings;
  if (const std::size_t count = stream ? stream->num_counted() : 0; count > 0) {
    all.push_back(
        fmt::format("{}: the video does not say when {} frames were taken: counted at {:g} Hz "
                    "(the camera file's rate_hz, else --rate, else the video's)",
                    name, count, stream->counted_hz));
  }
  return all;
}

std::vector<std::string> FrameSource::remarks() const {
  std::vector<std::string> all = warnings_so_far();
  all.insert(all.begin(), notes.begin(), notes.end());
  return all;
}

std::optional<int> dataset::camera_number(const fs::path& path) {
  constexpr std::string_view kPrefix = "camera:";
  constexpr std::size_t kMaxNumber = 1000;
  const std::string text = path.string();
  if (!text.starts_with(kPrefix)) {
    return std::nullopt;
  }
  const auto number = to_number<std::size_t>(std::string_view(text).substr(kPrefix.size()));
  return number && *number < kMaxNumber ? std::optional(static_cast<int>(*number)) : std::nullopt;
}

std::string dataset::without_secrets(const std::string& text) {
  static const std::regex kUser("://[^/ ]*@");  // a password may have an @ in it
  static const std::regex kQuery("(://[^ '?]*)\\?[^ ']*");
  return std::regex_replace(std::regex_replace(text, kUser, "://***@"), kQuery, "$1?***");
}

bool dataset::is_address(const fs::path& path) {
  constexpr std::string_view kKinds[] = {"rtsp://", "rtsps://", "http://", "https://"};
  return !is_file(path) && std::ranges::any_of(kKinds, [text = path.string()](auto kind) {
    return text.starts_with(kind);
  });
}

Config dataset::with_camera_height(Config config, const FrameSource& frames) {
  constexpr const char* kHeight = "scale.camera_height_m";
  // A file that names both keys is a dump of all, whose height is the default.
  const bool is_given =
      config.keys_overridden.contains(kHeight) ||
      (config.keys_in_file.contains(kHeight) && !config.keys_in_file.contains("scale.source"));
  if (config.scale_choice == ScaleChoice::kAuto && config.scale.source == ScaleSource::kNone &&
      (frames.is_kitti || frames.camera_height_m || is_given)) {
    config.scale.source = ScaleSource::kCameraHeight;
  }
  if (config.scale_choice == ScaleChoice::kAuto) {
    config.scale_choice = ScaleChoice::kOptions;
  }
  // A file's height is some camera's, often the default; that of the camera file is this one's.
  if (frames.camera_height_m && !config.keys_overridden.contains(kHeight)) {
    config.scale.camera_height_m = *frames.camera_height_m;
  }
  return config;
}

Expected<FrameSource> open_source(const FrameSourceRequest& request) {
  const fs::path& path = request.sequence_dir;
  if (is_file(path) && (is_bag(path) || dataset::is_image_file(path))) {
    return refuse(path);
  }
  const bool is_stream = dataset::camera_number(path) || dataset::is_address(path) || is_file(path);
  const auto listing = is_stream ? std::nullopt : find_listing(request);
  if (!is_stream && !listing && !is_folder(path)) {
    return refuse(path);
  }
  STEMVO_TRY(check_unused(request, listing.has_value(), is_stream));
  if (is_stream) {
    return dataset::open_video(request);
  }
  if (listing) {
    return listing->and_then(
        [&](const dataset::Listing& found) { return dataset::open_listing(found, request); });
  }
  if (!looks_like_kitti(path)) {
    return refuse(path);
  }
  return open_kitti(path, request);
}

}  // namespace stemvo
