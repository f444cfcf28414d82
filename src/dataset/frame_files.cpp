// SPDX-License-Identifier: MIT
#include "dataset/frame_files.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <system_error>

#include <fmt/format.h>

#include "dataset/image_names.hpp"
#include "odometry/check_frame.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace fs = std::filesystem;

namespace {

constexpr int kBlack = 128;

Status add_part(const std::string& part, cv::Mat& mask) {
  std::string words = part;
  std::ranges::replace(words, ',', ' ');
  if (const auto n = parse_numbers(words, 4)) {
    const cv::Rect inside =
        cv::Rect2d((*n)[0], (*n)[1], (*n)[2], (*n)[3]) & cv::Rect2d(0, 0, mask.cols, mask.rows);
    if (inside.empty()) {
      return fail(fmt::format("--mask {}: expected a rectangle inside frames of {}x{} pixels", part,
                              mask.cols, mask.rows));
    }
    mask(inside).setTo(0);
    return {};
  }
  const auto image = io::read_image(part, false);
  if (!image) {
    return fail(
        fmt::format("--mask: expected X,Y,WIDTH,HEIGHT in pixels of the frames, as "
                    "0,300,1241,76, or an image, found {}",
                    image.error().message));
  }
  if (image->size() != mask.size()) {
    return fail(fmt::format("{}: expected a mask of {}x{} pixels, as the frames, found {}x{}", part,
                            mask.cols, mask.rows, image->cols, image->rows));
  }
  mask.setTo(0, *image < kBlack);
  return {};
}

Expected<TimedRows<double>> find_times(const Listing& listing, const FrameSourceRequest& request) {
  const auto& file = request.times ? request.times : listing.times_file;
  if (request.rate_hz && (file || !listing.times_s.empty())) {
    return fail(fmt::format("--rate {}: expected images without times, found {}", *request.rate_hz,
                            file ? file->string() : "those of the list of images"));
  }
  if (!file) {
    return TimedRows<double>{listing.times_s, listing.note};
  }
  return read_kitti_times(*file, listing.files.size(), true);
}

/// Without times: the camera file's, else the rate asked for, else 30, with a note.
double rate_of(const CameraFile& camera, const FrameSourceRequest& request, FrameSource& frames) {
  constexpr double kUsualRate_hz = 30.0;
  if (!camera.rate_hz && !request.rate_hz) {
    add_line(frames.notes,
             fmt::format("times: {} frames per second are taken for granted; --rate HZ, "
                         "--times FILE or rate_hz in the camera file says another",
                         kUsualRate_hz));
  } else if (camera.rate_hz && request.rate_hz && *camera.rate_hz != *request.rate_hz) {
    frames.warnings.push_back(
        fmt::format("--rate {}: the camera file's rate_hz goes before it: {} frames per second",
                    *request.rate_hz, *camera.rate_hz));
  }
  return camera.rate_hz.value_or(request.rate_hz.value_or(kUsualRate_hz));
}

}  // namespace

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

std::string warn_of_spare_poses(const PoseFile& truth, std::size_t num_frames) {
  return truth.timestamps_s.empty() && truth.poses.size() > num_frames
             ? fmt::format("{}: {} poses for {} frames: the first ones are taken for theirs",
                           truth.file.string(), truth.poses.size(), num_frames)
             : "";
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
  const auto step_of = [](const std::vector<double>& times_s) {
    const auto count = static_cast<double>(times_s.size());
    return count > 1.0 ? (times_s.back() - times_s.front()) / (count - 1.0) : 0.0;
  };
  const double step_s = step_of(truth.timestamps_s);
  const double frames_s = step_of(frames.timestamps_s);
  const auto matched = match_frames(truth, frames.range.begin, frames.timestamps_s, tolerance_s);
  if (step_s > 0.0 && std::abs(step_s - frames_s) > 0.3 && (step_s == 1.0 || frames_s == 1.0) &&
      (!matched || truth.timestamps_s.size() == num_files)) {
    return fail(fmt::format("{}: expected steps as frames', {:g} s, found {:g}: numbers of frames?",
                            poses.string(), frames_s, step_s));
  }
  add_line(frames.warnings, warn_of_spare_poses(truth, num_files));
  STEMVO_TRY_GET(frames.ground_truth, matched);
  return {};
}

Status check_size(const cv::Size& found,
                  const Camera& camera,
                  const std::string& owner,
                  const fs::path& camera_file) {
  return camera.width_px == 0 || found == cv::Size(camera.width_px, camera.height_px)
             ? Status()
             : fail(fmt::format("{}: expected images of {}x{} pixels, as {} says, found {}x{}; "
                                "give the camera file of that size",
                                owner, camera.width_px, camera.height_px, camera_file.string(),
                                found.width, found.height));
}

Expected<FrameView> add_view(FrameSource& frames,
                             const CameraFile& camera,
                             const fs::path& camera_file,
                             const std::vector<std::string>& masks,
                             std::function<Expected<cv::Mat>(std::size_t)> read_whole) {
  STEMVO_TRY_GET(const FrameView view,
                 named(camera_file.string(), FrameView::create(camera.camera)));
  STEMVO_TRY_GET(const auto mask, make_mask(masks, view.full_size()));
  frames.given_calibration = camera_file;
  frames.camera_height_m = camera.camera_height_m;
  if (camera.body_from_camera) {
    frames.camera_from_imu = camera.body_from_camera->rotation.inverse();
  }
  frames.imu_from_camera_s = camera.imu_from_camera_s;
  frames.mask = view.apply_to_mask(mask);
  frames.full_size = view.full_size();
  frames.camera = view.camera();
  add_line(frames.warnings, doubt_of(frames.camera));
  frames.read = [view, read_whole = std::move(read_whole)](std::size_t index) {
    return read_whole(index).map(
        [&](const cv::Mat& image) { return image.empty() ? image : view.apply(image); });
  };
  return view;
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
  // A drive may begin in the dark: levels are those of images from all of it.
  constexpr std::size_t kNumSamples = 10;
  for (std::size_t i = 1; votes.front().used && i <= kNumSamples; ++i) {
    votes.push_back(
        io::read_image_kind(files[i * (files.size() - 1) / kNumSamples]).value_or(most));
  }
  const io::Levels levels = io::used_levels(votes);
  if (levels != io::Levels()) {
    frames.warnings.push_back(
        fmt::format("images of 16 bits: values from {} to {}, as in {} of them, are taken for "
                    "black to white",
                    levels.low, levels.high, votes.size()));
  }
  return SharedKind{most.size, most.is_color, levels};
}

Expected<PoseFile> read_truth(const fs::path& file, const std::optional<fs::path>& camera_file) {
  Expected<PoseFile> result = read_pose_file(file);
  if (!result || !result->is_of_body) {
    return result;
  }
  const fs::path folder = absolute_folder(file.parent_path().empty() ? "." : file.parent_path());
  const auto camera =
      read_camera_file(camera_file.value_or(folder.parent_path() / "cam0/sensor.yaml"));
  if (!camera || !camera->body_from_camera) {
    return fail(fmt::format(
        "{}: expected a camera file with T_BS, for these are poses of the body: --camera FILE, or "
        "../cam0/sensor.yaml from there; found {}",
        file.string(), camera ? "one without T_BS" : camera.error().message));
  }
  for (Rigid3& pose : result->poses) {
    pose = pose * *camera->body_from_camera;
  }
  result->is_of_body = false;
  return result;
}

Status check_pairs(const PoseFile& truth,
                   const std::string& owner,
                   std::span<const double> times_s,
                   const TimePairs& pairs,
                   double tolerance_s) {
  constexpr std::size_t kMinPairs = 2;
  if (pairs.first.size() >= kMinPairs) {
    return {};
  }
  return fail(fmt::format(
      "{}: expected at least {} poses within {} s of times in {}, found {}; poses are of {:.3f} to "
      "{:.3f} s, the others of {:.3f} to {:.3f} s (see --gt-tolerance)",
      truth.file.string(), kMinPairs, tolerance_s, owner, pairs.first.size(),
      truth.timestamps_s.front(), truth.timestamps_s.back(), times_s.front(), times_s.back()));
}

Expected<GroundTruth> match_frames(const PoseFile& truth,
                                   std::size_t begin,
                                   const std::vector<double>& times_s,
                                   double tolerance_s) {
  if (!truth.timestamps_s.empty()) {
    const TimePairs pairs = pair_by_time(times_s, truth.timestamps_s, tolerance_s);
    STEMVO_TRY(check_pairs(truth, "the frames", times_s, pairs, tolerance_s));
    return GroundTruth{relative_to_first(take_poses(truth.poses, pairs.second)), pairs.first};
  }
  if (truth.poses.size() < begin + times_s.size()) {
    return fail(fmt::format("{}: expected a pose for each of {} frames, found {} poses",
                            truth.file.string(), begin + times_s.size(), truth.poses.size()));
  }
  GroundTruth result{relative_to_first(std::span(truth.poses).subspan(begin, times_s.size())),
                     std::vector<std::size_t>(times_s.size())};
  std::iota(result.frames.begin(), result.frames.end(), std::size_t{0});
  return result;
}

Expected<cv::Mat> make_mask(const std::vector<std::string>& parts, cv::Size size) {
  if (parts.empty()) {
    return cv::Mat();
  }
  cv::Mat mask(size, CV_8UC1, cv::Scalar(255));
  for (const std::string& part : parts) {
    STEMVO_TRY(add_part(part, mask));
  }
  if (cv::countNonZero(mask) == 0) {
    return fail("--mask: expected a part of the frames that is left, found none");
  }
  return mask;
}

Expected<FrameSource> open_listing(const Listing& listing, const FrameSourceRequest& request) {
  const auto camera_path = request.camera_file ? request.camera_file : listing.camera_file;
  if (!camera_path) {
    return fail(
        fmt::format("{}: a {}: expected --camera FILE or camera.yaml in it, found neither; "
                    "'stemvo run --help' shows what it holds",
                    request.sequence_dir.string(), listing.kind));
  }
  STEMVO_TRY_GET(const auto camera_file, read_camera_file(*camera_path));
  STEMVO_TRY_GET(const auto range, resolve_range(request.frames, listing.files.size(),
                                                 request.sequence_dir.string()));
  STEMVO_TRY_GET(auto times, find_times(listing, request));
  const bool has_times = !times.rows.empty();
  times.rows.resize(listing.files.size());
  FrameSource frames = list_frames(range, listing.files, times.rows);
  frames.warnings = camera_file.warnings;
  add_line(frames.notes, times.note);
  if (!has_times) {
    const double rate_hz = rate_of(camera_file, request, frames);
    const std::vector<double> steps = count_frames(listing.files, frames.warnings);
    for (std::size_t i = 0; i < frames.timestamps_s.size(); ++i) {
      frames.timestamps_s[i] = steps[range.begin + i] / rate_hz;
    }
  }
  if (const auto& truth = request.ground_truth ? request.ground_truth : listing.ground_truth) {
    STEMVO_TRY(add_ground_truth(frames, *truth, camera_path, request.ground_truth_tolerance_s,
                                listing.files.size(), true));
  }
  add_line(frames.warnings, listing.warning);
  STEMVO_TRY_GET(const auto kind, vote_on_images(frames));
  STEMVO_TRY(check_size(kind.size, camera_file.camera, listing.folder.string(), *camera_path));
  frames.kind = listing.kind;
  frames.name = listing.name;
  const auto read = [files = frames.files, kind](std::size_t i) {
    return io::read_image(files[i], kind.is_color, kind.size, kind.levels);
  };
  STEMVO_TRY(add_view(frames, camera_file, *camera_path, request.masks, read));
  return frames;
}

}  // namespace stemvo::dataset
