// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>
#include <system_error>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "dataset/frame_source.hpp"
#include "io/image_file.hpp"
#include "odometry/check_frame.hpp"
#include "stemvo/rigid3.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace {

/// Which camera's projection row a line is; nullopt: another line.
std::optional<int> camera_of(std::string_view line) {
  const std::string_view name = take_word(line);
  for (int i = 0; i < 4; ++i) {
    if (name == fmt::format("P{}:", i) || name == fmt::format("P_rect_0{}:", i)) {
      return i;
    }
  }
  return std::nullopt;
}

Expected<Matrix34d> parse_projection(std::string_view line) {
  return parse_numbers(line.substr(line.find(':') + 1), 12).map([](const auto& numbers) {
    return Matrix34d(
        Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(numbers.data()));
  });
}

/// Error: anything but [f 0 c . | 0 f c . | 0 0 1 .], which is a rectified pinhole camera.
Expected<Camera> to_camera(const Matrix34d& p) {
  if (!(p(0, 0) >= 1.0) || !(p(1, 1) >= 1.0)) {
    return fail(fmt::format("expected focal lengths of at least 1 pixel, found {} and {}", p(0, 0),
                            p(1, 1)));
  }
  constexpr double kTolerance = 1e-6;
  const bool is_pinhole =
      std::abs(p(0, 1)) <= kTolerance * p(0, 0) && std::abs(p(1, 0)) <= kTolerance * p(1, 1) &&
      (p.row(2).head<3>() - Eigen::RowVector3d::UnitZ()).cwiseAbs().maxCoeff() <= kTolerance;
  if (!is_pinhole) {
    return fail(fmt::format(
        "expected a pinhole camera [f 0 c; 0 f c; 0 0 1], found [{} {} {}; {} {} {}; "
        "{} {} {}]",
        p(0, 0), p(0, 1), p(0, 2), p(1, 0), p(1, 1), p(1, 2), p(2, 0), p(2, 1), p(2, 2)));
  }
  return Camera{p(0, 0), p(1, 1), p(0, 2), p(1, 2)};
}

}  // namespace

Expected<Camera> read_kitti_camera(const std::filesystem::path& file, int index) {
  STEMVO_TRY_GET(const auto lines, read_lines(file, kMaxSettings_MB));
  std::optional<Camera> camera;
  cv::Size size;  // zero: the file says none
  for (std::size_t i = 0; i < lines.size(); ++i) {
    std::string_view rest = lines[i];
    if (camera_of(rest) == index) {
      STEMVO_TRY_GET(camera, at_line(file, i, parse_projection(rest).and_then(to_camera)));
    } else if (take_word(rest) == fmt::format("S_rect_0{}:", index)) {
      STEMVO_TRY_GET(const auto sides, at_line(file, i, parse_numbers(rest, 2)));
      size = cv::Size2d(sides[0], sides[1]);
    }
  }
  if (!camera) {
    return fail(fmt::format("{}: expected a row 'P{}:' for image_{}, found none in {} lines",
                            file.string(), index, index, lines.size()));
  }
  camera->width_px = size.width;
  camera->height_px = size.height;
  return *camera;
}

Expected<std::string> replace_kitti_camera(const std::filesystem::path& file,
                                           const Camera& given,
                                           const Camera& refined) {
  STEMVO_TRY_GET(const auto lines, read_lines(file, kMaxSettings_MB));
  std::string text;
  for (const std::string& line : lines) {
    Expected<Matrix34d> row = parse_projection(line);
    const bool is_given =
        camera_of(line) && row &&
        (row->leftCols<3>() - given.matrix()).cwiseAbs().maxCoeff() <= 1e-6 * given.mean_focal_px();
    if (!is_given) {
      text += line + "\n";
      continue;
    }
    const Eigen::Vector3d offset_m = given.matrix().inverse() * row->col(3);
    row->leftCols<3>() = refined.matrix();
    row->col(3) = refined.matrix() * offset_m;
    text += split_words(line).front();
    for (int i = 0; i < 12; ++i) {
      text += fmt::format(" {:.12e}", (*row)(i / 4, i % 4));
    }
    text += '\n';
  }
  return text;
}

Expected<TimedRows<double>> read_kitti_times(const std::filesystem::path& file,
                                             std::size_t num_expected,
                                             bool is_exact) {
  STEMVO_TRY_GET(const auto found, read_timed_rows(file, {1}, "a time"));
  TimedRows<double> times{.note = found.note};
  for (const TimedRow& row : found.rows) {
    times.rows.push_back(row.time_s);
  }
  constexpr std::size_t kFew = 3;
  const double last = times.rows.front() + static_cast<double>(times.rows.size()) - 1.0;
  if (times.rows.size() >= kFew && times.rows[0] <= 1.0 && times.rows.back() == last) {
    times.note = fmt::format(
        "{}: times {:g}, {:g}, .. are taken for seconds; numbers of frames would be no times",
        file.string(), times.rows[0], times.rows[1]);
  }
  if (times.rows.size() < num_expected || (is_exact && times.rows.size() > num_expected)) {
    return fail(fmt::format("{}: expected a time for each of {} images, found {} times",
                            file.string(), num_expected, times.rows.size()));
  }
  return times;
}

}  // namespace stemvo::dataset

namespace stemvo {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDigits = 6;  // of KITTI's %06d.png

/// 0..3; colour cameras are 2 and 3.
Expected<int> choose_camera(const fs::path& directory, const std::string& option) {
  for (const int index : {2, 0, 1, 3}) {
    const std::string name = fmt::format("image_{}", index);
    if ((option == name || (option == "auto" && index % 2 == 0)) && is_folder(directory / name)) {
      return index;
    }
  }
  return fail(fmt::format("{}: expected a folder {}, found none", directory.string(),
                          option == "auto" ? "image_2 or image_0" : option));
}

/// Frames 000000.png, 000001.png, ... without a gap. Thumbnails and notes may lie beside them.
Expected<std::vector<fs::path>> list_images(const fs::path& folder) {
  STEMVO_TRY_GET(const auto found, dataset::list_folder(folder));
  std::vector<std::pair<std::size_t, fs::path>> numbered;
  for (const fs::path& file : found) {
    const std::string stem = file.stem().string();
    const auto number = to_number<std::size_t>(stem);
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

Status set_images(const fs::path& calibration, bool is_color, FrameSource& frames) {
  STEMVO_TRY_GET(const auto kind, dataset::vote_on_images(frames));
  STEMVO_TRY(dataset::check_size(kind.size, frames.camera,
                                 frames.files.front().parent_path().string(), calibration));
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
  constexpr const char* kNames[] = {"image_0", "image_1", "image_2", "image_3", "calib.txt"};
  return std::ranges::any_of(kNames, [&](auto name) { return is_there(folder / name); });
}

Expected<FrameSource> open_kitti(const fs::path& directory, const SequenceOptions& options) {
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
