// SPDX-License-Identifier: MIT
#include <algorithm>
#include <charconv>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "dataset/kitti_text.hpp"
#include "dataset/png_file.hpp"
#include "stemvo/check.hpp"
#include "stemvo/dataset/sequence.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDigits = 6;  // of KITTI's %06d.png

/// 0..3; colour cameras are 2 and 3.
Expected<int> choose_camera(const fs::path& directory, const std::string& option) {
  if (option == "auto") {
    if (dataset::is_folder(directory / "image_2")) {
      return 2;
    }
    if (dataset::is_folder(directory / "image_0")) {
      return 0;
    }
    return fail(
        fmt::format("{}: expected a folder image_2 or image_0, found neither", directory.string()));
  }
  for (int index = 0; index < 4; ++index) {
    const std::string name = fmt::format("image_{}", index);
    if (option == name) {
      if (!dataset::is_folder(directory / name)) {
        return fail(fmt::format("{}: expected a folder (input.camera is {}), found none",
                                (directory / name).string(), name));
      }
      return index;
    }
  }
  return fail(fmt::format("input.camera: expected auto or image_0 .. image_3, found '{}'", option));
}

std::optional<std::size_t> frame_number(const fs::path& file) {
  const std::string stem = file.stem().string();
  std::size_t number = 0;
  const auto [end, code] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
  const bool is_number = code == std::errc() && end == stem.data() + stem.size();
  if (!is_number || stem.size() < kDigits || file.extension() != ".png") {
    return std::nullopt;  // not a frame: thumbnails and notes may lie beside the frames
  }
  return number;
}

/// Frames 000000.png, 000001.png, ... without a gap.
Expected<std::vector<fs::path>> list_frames(const fs::path& folder) {
  std::vector<std::pair<std::size_t, fs::path>> found;
  std::error_code code;
  fs::directory_iterator entry(folder, code);
  for (; !code && entry != fs::directory_iterator(); entry.increment(code)) {
    if (const auto number = frame_number(entry->path())) {
      found.emplace_back(*number, entry->path());
    }
  }
  if (code) {
    return fail(fmt::format("{}: cannot list the folder: {}", folder.string(), code.message()));
  }
  if (found.empty()) {
    return fail(fmt::format("{}: expected images 000000.png, 000001.png, ..., found none",
                            folder.string()));
  }
  std::sort(found.begin(), found.end());
  std::vector<fs::path> files;
  for (auto& [number, file] : found) {
    if (number != files.size()) {
      return fail(fmt::format("{}: expected {:06}.png next, found {} (a gap in the numbering)",
                              folder.string(), files.size(), file.filename().string()));
    }
    files.push_back(std::move(file));
  }
  return files;
}

/// The size most of the first readable frames have.
Expected<cv::Size> find_image_size(const std::vector<fs::path>& files, bool is_color) {
  return dataset::vote_on_pictures<cv::Size>(
      files, [is_color](const fs::path& file) -> Expected<cv::Size> {
        return dataset::read_png(file, is_color).map([](const cv::Mat& m) { return m.size(); });
      });
}

/// `../../poses/NN.txt` as typed, or behind a link to the folder; nullopt if neither exists.
std::optional<fs::path> find_ground_truth(const fs::path& absolute, const std::string& name) {
  std::error_code code;
  for (const fs::path& base : {absolute, fs::weakly_canonical(absolute, code)}) {
    fs::path file = base.parent_path().parent_path() / "poses" / (name + ".txt");
    if (fs::exists(file, code)) {
      return file;
    }
  }
  return std::nullopt;
}

Expected<Trajectory> read_ground_truth(const fs::path& file, const FrameRange& range) {
  const auto poses = read_kitti_trajectory(file);
  if (!poses) {
    return fail(poses.error().message);
  }
  if (poses->size() < range.end) {
    return fail(fmt::format("{}: expected a pose for each frame up to {}, found {} poses",
                            file.string(), range.end - 1, poses->size()));
  }
  return relative_to_first(std::span(*poses).subspan(range.begin, range.end - range.begin));
}

}  // namespace

Expected<KittiSequence> KittiSequence::open(const fs::path& directory,
                                            const SequenceOptions& options) {
  if (!dataset::is_folder(directory)) {
    return fail(fmt::format("{}: expected a sequence folder, found none", directory.string()));
  }
  const auto camera_index = choose_camera(directory, options.camera);
  if (!camera_index) {
    return fail(camera_index.error().message);
  }
  const fs::path image_folder = directory / fmt::format("image_{}", *camera_index);
  const auto images = list_frames(image_folder);
  if (!images) {
    return fail(images.error().message);
  }
  const auto range = dataset::resolve_range(options.frames, images->size(), image_folder);
  if (!range) {
    return fail(range.error().message);
  }
  const fs::path calibration = options.calibration.value_or(directory / "calib.txt");
  const auto camera = dataset::read_kitti_camera(calibration, *camera_index);
  if (!camera) {
    return fail(camera.error().message);
  }
  const auto times_s = dataset::read_kitti_times(directory / "times.txt", range->end);
  if (!times_s) {
    return fail(times_s.error().message);
  }
  const fs::path absolute = dataset::absolute_folder(directory);

  FrameList frames;
  frames.name = absolute.filename().string();
  frames.range = *range;
  frames.camera = *camera;
  frames.given_calibration = options.calibration;
  frames.files = dataset::cut(*images, *range);
  frames.timestamps_s = dataset::cut(*times_s, *range);

  const auto pose_file =
      options.ground_truth ? options.ground_truth : find_ground_truth(absolute, frames.name);
  if (pose_file) {
    auto poses = read_ground_truth(*pose_file, *range);
    if (!poses) {
      return fail(poses.error().message);
    }
    frames.ground_truth = std::move(*poses);
    frames.ground_truth_file = *pose_file;
  }
  const bool is_color = *camera_index >= 2;
  const auto size = find_image_size(frames.files, is_color);
  if (!size) {
    return fail(size.error().message);
  }
  frames.camera.width_px = size->width;
  frames.camera.height_px = size->height;
  if (options.calibration && !dataset::has_center_inside(frames.camera)) {
    return fail(fmt::format(
        "{}: expected a principal point inside pictures of {}x{} pixels, found ({}, {}): a "
        "calibration of another picture size",
        calibration.string(), size->width, size->height, camera->cx_px, camera->cy_px));
  }
  return KittiSequence(std::move(frames), is_color);
}

Expected<cv::Mat> KittiSequence::read(std::size_t index) const {
  STEMVO_CHECK(index < size(), "frame index inside the range");
  auto image = dataset::read_png(file(index), is_color_);
  if (!image) {
    return image;
  }
  if (const Status status = dataset::check_size(file(index), *image, camera()); !status) {
    return fail(status.error().message);
  }
  return image;
}

}  // namespace stemvo
