// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <system_error>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "dataset/frame_source.hpp"
#include "io/image_file.hpp"
#include "odometry/check_frame.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDigits = 6;  // of KITTI's %06d.png

/// 0..3; colour cameras are 2 and 3.
Expected<int> choose_camera(const fs::path& directory, const std::string& option) {
  constexpr std::array<int, 4> kOrder = {2, 0, 1, 3};
  const auto is_there = [&](int index) {
    return dataset::is_folder(directory / fmt::format("image_{}", index));
  };
  const auto found = std::ranges::find_if(kOrder, [&](int index) {
    return option == "auto" ? index % 2 == 0 && is_there(index)
                            : option == fmt::format("image_{}", index);
  });
  if (found == kOrder.end() && option != "auto") {
    return fail(
        fmt::format("input.camera: expected auto or image_0 .. image_3, found '{}'", option));
  }
  if (found == kOrder.end() || !is_there(*found)) {
    // Commands that read other recordings too open none of them as KITTI's.
    const char* why = looks_like_kitti(directory)
                          ? ""
                          : "; this command reads KITTI's layout only (image_2/000000.png, .., "
                            "calib.txt, times.txt), 'stemvo run' others too";
    return fail(fmt::format("{}: expected a folder {}, found none{}", directory.string(),
                            option == "auto" ? "image_2 or image_0" : option, why));
  }
  return *found;
}

/// Frames 000000.png, 000001.png, ... without a gap. Thumbnails and notes may lie beside them.
Expected<std::vector<fs::path>> list_images(const fs::path& folder) {
  STEMVO_TRY_GET(const auto found, dataset::list_folder(folder));
  std::vector<std::pair<std::size_t, fs::path>> numbered;
  for (const fs::path& file : found) {
    const std::string stem = file.stem().string();
    const auto number = parse_index(stem);
    if (number && stem.size() >= kDigits && file.extension() == ".png") {
      numbered.emplace_back(*number, file);
    }
  }
  if (numbered.empty()) {
    return fail(fmt::format("{}: expected images 000000.png, 000001.png, ..., found none",
                            folder.string()));
  }
  std::sort(numbered.begin(), numbered.end());
  std::vector<fs::path> files;
  for (auto& [number, file] : numbered) {
    if (number != files.size()) {
      return fail(fmt::format("{}: expected {:06}.png next, found {} (a gap in the numbering)",
                              folder.string(), files.size(), file.filename().string()));
    }
    files.push_back(std::move(file));
  }
  return files;
}

/// `../../poses/NN.txt` as typed, or behind a link to the folder; nullopt if neither exists. A link
/// to nowhere is one: poses that cannot be read are not poses that are not there.
std::optional<fs::path> find_ground_truth(const fs::path& absolute, const std::string& name) {
  std::error_code code;
  for (const fs::path& base : {absolute, fs::weakly_canonical(absolute, code)}) {
    fs::path file = base.parent_path().parent_path() / "poses" / (name + ".txt");
    if (fs::exists(fs::symlink_status(file, code))) {
      return file;
    }
  }
  return std::nullopt;
}

/// Sets the size that most images have, and how one is read.
Status set_images(const fs::path& calibration, bool is_color, FrameSource& frames) {
  STEMVO_TRY_GET(const auto kind, dataset::vote_on_images(frames));
  frames.full_size = kind.size;
  frames.camera.width_px = kind.size.width;
  frames.camera.height_px = kind.size.height;
  add_line(frames.warnings, doubt_of(frames.camera));
  frames.read = [files = frames.files, is_color, kind](std::size_t index) {
    return io::read_image(files[index], is_color, kind.size, kind.levels);
  };
  return check_camera(frames.camera, calibration.string());
}

}  // namespace

bool looks_like_kitti(const fs::path& folder) {
  std::error_code code;
  for (const char* name : {"image_0", "image_1", "image_2", "image_3", "calib.txt"}) {
    if (fs::exists(folder / name, code)) {
      return true;
    }
  }
  return false;
}

Expected<FrameSource> open_kitti(const fs::path& directory, const SequenceOptions& options) {
  if (!dataset::is_folder(directory)) {
    return fail(fmt::format("{}: expected a sequence folder, found none; check the path",
                            directory.string()));
  }
  STEMVO_TRY_GET(const auto camera_index, choose_camera(directory, options.camera));
  const fs::path image_folder = directory / fmt::format("image_{}", camera_index);
  STEMVO_TRY_GET(const auto images, list_images(image_folder));
  STEMVO_TRY_GET(const auto range,
                 dataset::resolve_range(options.frames, images.size(), image_folder.string()));
  const fs::path calibration = options.calibration.value_or(directory / "calib.txt");
  STEMVO_TRY_GET(const auto camera, dataset::read_kitti_camera(calibration, camera_index));
  STEMVO_TRY_GET(const auto times, dataset::read_kitti_times(directory / "times.txt", range.end));
  const fs::path absolute = dataset::absolute_folder(directory);
  FrameSource frames = dataset::list_frames(range, images, times.rows);
  add_line(frames.notes, times.note);
  frames.kind = "KITTI sequence";
  frames.is_kitti = true;
  frames.name = absolute.filename().string();
  frames.camera = camera;
  frames.given_calibration = options.calibration;
  const auto truth =
      options.ground_truth ? options.ground_truth : find_ground_truth(absolute, frames.name);
  if (truth) {
    STEMVO_TRY(dataset::add_ground_truth(frames, *truth, std::nullopt,
                                         options.ground_truth_tolerance_s, images.size(), false));
  }
  STEMVO_TRY(set_images(calibration, camera_index >= 2, frames));
  STEMVO_TRY_GET(frames.mask, dataset::make_mask(options.masks, frames.full_size));
  return frames;
}

}  // namespace stemvo
