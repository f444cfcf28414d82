// SPDX-License-Identifier: MIT
#include "dataset/frame_files.hpp"

#include <algorithm>
#include <span>
#include <system_error>

#include <fmt/format.h>

#include "odometry/check_frame.hpp"
#include "try.hpp"

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

std::string recording_name(const fs::path& folder) {
  const fs::path absolute = absolute_folder(folder);
  for (fs::path part = absolute; part.has_filename(); part = part.parent_path()) {
    std::string name = part.filename().string();
    const bool is_numbered = matches_pattern(name, "cam?") || matches_pattern(name, "image_?");
    if (!is_numbered && name != "images" && name != "rgb" && name != "data" && name != "mav0") {
      return name;
    }
  }
  return absolute.filename().string();
}

Expected<std::vector<fs::path>> list_folder(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code code;
  fs::directory_iterator entry(folder, code);
  for (; !code && entry != fs::directory_iterator(); entry.increment(code)) {
    found.push_back(entry->path());
  }
  if (code) {
    return fail(fmt::format("{}: cannot list the folder: {}", folder.string(), code.message()));
  }
  return found;
}

Expected<FrameRange> resolve_range(const std::optional<FrameRangeRequest>& request,
                                   std::size_t count,
                                   const std::string& owner,
                                   std::string_view things) {
  if (!request) {
    return FrameRange{0, count};
  }
  const FrameRange range{request->begin, request->end.value_or(count)};
  if (range.begin >= range.end || range.end > count) {
    const std::string end = request->end ? std::to_string(*request->end) : "";
    return fail(fmt::format("{}: expected {} inside 0:{}, found --{} {}:{}", owner, things, count,
                            things, request->begin, end));
  }
  return range;
}

FrameSource list_frames(const FrameRange& range,
                        const std::vector<fs::path>& files,
                        const std::vector<double>& times_s) {
  const auto cut = [&](const auto& all) {
    return std::span(all).subspan(range.begin, range.end - range.begin);
  };
  FrameSource frames;
  frames.range = range;
  frames.files.assign(cut(files).begin(), cut(files).end());
  frames.timestamps_s.assign(cut(times_s).begin(), cut(times_s).end());
  return frames;
}

Status add_ground_truth(FrameSource& frames,
                        const fs::path& poses,
                        const std::optional<fs::path>& camera_file,
                        double tolerance_s,
                        std::size_t num_files,
                        bool is_exact) {
  STEMVO_TRY_GET(const auto truth, read_truth(poses, camera_file));
  frames.ground_truth_file = poses;
  if (is_exact && truth.timestamps_s.empty() && truth.poses.size() != num_files) {
    return fail(fmt::format("{}: expected a pose for each of {} images, found {} poses",
                            poses.string(), num_files, truth.poses.size()));
  }
  STEMVO_TRY_GET(frames.ground_truth,
                 match_frames(truth, frames.range.begin, frames.timestamps_s, tolerance_s));
  return {};
}

void add_note(FrameSource& frames, const std::string& note) {
  if (!note.empty()) {
    frames.notes.push_back(note);
  }
}

double rate_of(const CameraFile& camera, const FrameSourceRequest& request, FrameSource& frames) {
  constexpr double kUsualRate_hz = 30.0;
  if (!camera.rate_hz && !request.rate_hz) {
    add_note(frames, fmt::format("times: {} frames per second are taken for granted; --rate HZ, "
                                 "--times FILE or rate_hz in the camera file says another",
                                 kUsualRate_hz));
  } else if (camera.rate_hz && request.rate_hz && *camera.rate_hz != *request.rate_hz) {
    frames.warnings.push_back(
        fmt::format("--rate {}: the camera file's rate_hz goes before it: {} frames per second",
                    *request.rate_hz, *camera.rate_hz));
  }
  return camera.rate_hz.value_or(request.rate_hz.value_or(kUsualRate_hz));
}

void warn_of_camera(FrameSource& frames) {
  if (std::string doubt = doubt_of(frames.camera); !doubt.empty()) {
    frames.warnings.push_back(std::move(doubt));
  }
}

Expected<FrameView> view_of(const Camera& camera, const fs::path& camera_file) {
  auto view = FrameView::create(camera);
  return view ? view : fail(camera_file.string() + ": " + view.error().message);
}

Status add_view(FrameSource& frames,
                const FrameView& view,
                const std::vector<std::string>& masks,
                std::function<Expected<cv::Mat>(std::size_t)> read_whole) {
  STEMVO_TRY_GET(const auto mask, make_mask(masks, view.full_size()));
  frames.mask = view.apply_to_mask(mask);
  frames.full_size = view.full_size();
  frames.camera = view.camera();
  warn_of_camera(frames);
  frames.read = [view, read_whole = std::move(read_whole)](std::size_t index) {
    return read_whole(index).map(
        [&](const cv::Mat& image) { return image.empty() ? image : view.apply(image); });
  };
  return {};
}

Expected<SharedKind> vote_on_images(FrameSource& frames) {
  const std::vector<fs::path>& files = frames.files;
  constexpr std::size_t kNumVotes = 5;
  std::string first_message;
  std::vector<io::ImageKind> votes;
  for (auto file = files.begin(); file != files.end() && votes.size() < kNumVotes; ++file) {
    const auto kind = io::read_image_kind(*file);
    if (kind) {
      votes.push_back(*kind);
    } else if (first_message.empty()) {
      first_message = kind.error().message;
    }
  }
  if (votes.empty()) {
    return fail(
        fmt::format("none of {} images can be read; the first: {}", files.size(), first_message));
  }
  if (const int turn = votes.front().orientation; turn > 1 && turn <= 8) {
    frames.warnings.push_back(fmt::format(
        "images: EXIF says that they are to be shown turned or mirrored (orientation {}): rows and "
        "columns are taken as they are stored, as the camera file has to be of",
        turn));
  }
  const auto num_votes = [&](const io::ImageKind& kind) {
    return std::ranges::count_if(votes, [&](const io::ImageKind& other) {
      return other.size == kind.size && other.is_color == kind.is_color;
    });
  };
  const io::ImageKind most = *std::ranges::max_element(votes, {}, num_votes);
  const io::Levels levels = io::used_levels(votes);
  if (levels != io::Levels()) {
    frames.warnings.push_back(
        fmt::format("images of 16 bits: values from {} to {}, as in the first ones, are taken for "
                    "black to white",
                    levels.low, levels.high));
  }
  return SharedKind{most.size, most.is_color, levels};
}

}  // namespace stemvo::dataset
