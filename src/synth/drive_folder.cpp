// SPDX-License-Identifier: MIT
#include "synth/drive_folder.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "internal_check.hpp"
#include "io/png.hpp"
#include "stem/model_file.hpp"
#include "text/text_file.hpp"

namespace stemvo::synth {
namespace {

namespace fs = std::filesystem;

/// Says in a folder that it holds nothing but what was rendered, which is this; in it the hashes of
/// the texts, which a user may have edited.
constexpr std::string_view kMark = "rendered_by_stemvo";
constexpr std::string_view kPoses = "poses.txt";
constexpr std::array<std::string_view, 4> kTexts = {"calib.txt", "times.txt", "camera.yaml",
                                                    kPoses};
constexpr std::array<std::string_view, 6> kContents = {"image_2",   "depth",       "calib.txt",
                                                       "times.txt", "camera.yaml", "poses.txt"};

Error cannot(const char* what, const fs::path& path, const std::error_code& code) {
  return fail(fmt::format("{}: cannot {}: {}", path.string(), what, code.message()));
}

/// All that is in the folder, if it is there, is such an entry.
template <typename Predicate>
bool holds_only(const fs::path& folder, const Predicate& is_ours) {
  std::error_code code;
  const bool is_only = std::all_of(fs::directory_iterator(folder, code), fs::directory_iterator(),
                                   [&](const auto& entry) { return is_ours(entry); });
  return is_only && (!code || code == std::errc::no_such_file_or_directory);
}

/// A user may have put results or masks beside it, or notes among the frames.
bool holds_only_a_drive(const fs::path& folder) {
  const auto final_name = [](const fs::path& name) {  // a kill may have left one unfinished
    return name.extension() == ".unfinished" ? name.stem() : name;
  };
  const auto is_frame = [&](const fs::directory_entry& entry) {
    const fs::path frame = final_name(entry.path().filename());
    const std::string number = frame.stem().string();
    return entry.is_regular_file() &&
           (frame.extension() == ".png" || frame.extension() == ".npy") && number.size() == 6 &&
           number.find_first_not_of("0123456789") == number.npos;
  };
  const auto is_content = [&](const fs::directory_entry& entry) {
    const std::string content = final_name(entry.path().filename()).string();
    const bool is_known =
        content == kMark || std::ranges::find(kContents, content) != kContents.end();
    return is_known && entry.is_directory() == (content == "image_2" || content == "depth");
  };
  return holds_only(folder, is_content) && holds_only(folder / "image_2", is_frame) &&
         holds_only(folder / "depth", is_frame);
}

/// The mark last: a kill leaves what the next drive may remove.
std::error_code remove_drive(const fs::path& folder) {
  std::error_code code;
  for (const std::string_view name : kContents) {
    if (!code) {
      fs::remove_all(folder / name, code);
    }
  }
  if (!code) {
    fs::remove_all(folder, code);
  }
  return code;
}

}  // namespace

DriveFolder::DriveFolder(const fs::path& out_dir, const std::string& name)
    : sequence_dir_(out_dir / "sequences" / (name + ".unfinished")),
      final_dir_(out_dir / "sequences" / name),
      replaced_dir_(out_dir / "sequences" / (name + ".replaced")),
      final_poses_(out_dir / "poses" / (name + ".txt")) {}

Expected<pipeline::FolderLock> DriveFolder::prepare(bool with_depth) const {
  if (const Status status = check_final_names(); !status) {
    return status.error();
  }
  std::error_code code;
  fs::create_directories(sequence_dir_, code);
  if (code) {
    return cannot("create the folder", sequence_dir_, code);
  }
  auto lock = pipeline::lock_folder(sequence_dir_);
  const Status status = lock ? make_folders(with_depth) : Status(lock.error());
  return status ? std::move(lock) : status.error();
}

Status DriveFolder::check_final_names() const {
  std::error_code code;
  // Killed in finish(), only the unfinished folder says whose the poses are.
  const bool is_ours =
      has_earlier() ? holds_only_a_drive(final_dir_)
                    : fs::exists(sequence_dir_ / kMark, code) && !fs::exists(final_dir_, code);
  for (const fs::path& path : {final_dir_, final_poses_}) {
    const bool is_empty = fs::is_directory(path, code) && fs::is_empty(path, code);
    if (!is_ours && fs::exists(path, code) && !is_empty) {
      return fail(
          fmt::format("{}: expected a drive that stemvo rendered, which a new one may replace, "
                      "or none, found something else (--name gives another name)",
                      path.string()));
    }
  }
  if (fs::exists(replaced_dir_, code) && !fs::exists(replaced_dir_ / kMark, code) &&
      !fs::is_empty(replaced_dir_, code)) {
    return fail(fmt::format("{}: expected a drive that was replaced or none, found something else",
                            replaced_dir_.string()));
  }
  return check_texts();
}

Status DriveFolder::check_texts() const {
  const std::string mark = read_text_file(final_dir_ / kMark).value_or("");
  for (std::string_view line : split_lines(mark)) {
    const std::string_view hash = take_word(line);
    const std::string_view name = take_word(line);
    const fs::path file = name == kPoses ? final_poses_ : final_dir_ / name;
    const auto text = read_text_file(file);
    if (text && internal::sha256_hex(*text) != hash) {
      return fail(
          fmt::format("{}: expected it as stemvo rendered it, so that a new drive may replace "
                      "it, found it changed (--name gives another name)",
                      file.string()));
    }
  }
  return {};
}

Status DriveFolder::mark_texts() const {
  std::string mark;
  for (const std::string_view name : kTexts) {
    if (const auto text = read_text_file(sequence_dir_ / name)) {
      mark += fmt::format("{} {}\n", internal::sha256_hex(*text), name);
    }
  }
  return write_text_file(sequence_dir_ / kMark, mark);
}

Status DriveFolder::make_folders(bool with_depth) const {
  std::error_code code;
  const bool is_new =
      holds_only(sequence_dir_, [](const auto& entry) { return entry.path().stem() == kMark; });
  const bool is_ours = fs::exists(sequence_dir_ / kMark, code) && holds_only_a_drive(sequence_dir_);
  if (!is_ours && !is_new) {
    return fail(fmt::format("{}: expected an unfinished drive or none, found something else",
                            sequence_dir_.string()));
  }
  if (Status marked = write_text_file(sequence_dir_ / kMark, ""); !marked) {
    return marked;
  }
  for (const std::string_view name : kContents) {
    fs::remove_all(sequence_dir_ / name, code);
    if (code) {
      return cannot("remove the unfinished drive", sequence_dir_, code);
    }
  }
  for (const fs::path& folder :
       {sequence_dir_ / "image_2", final_poses_.parent_path(), sequence_dir_ / "depth"}) {
    if (with_depth || folder.filename() != "depth") {
      if (const Status made = pipeline::create_out_folder(folder); !made) {
        return made;
      }
    }
  }
  return {};
}

bool DriveFolder::has_earlier() const {
  std::error_code code;
  return fs::exists(final_dir_ / kMark, code);
}

Status DriveFolder::abandon() const {
  const std::error_code code = remove_drive(sequence_dir_);
  return code ? Status(cannot("remove the unfinished drive", sequence_dir_, code)) : Status();
}

Status DriveFolder::finish() const {
  if (Status status = mark_texts(); !status) {
    return status;
  }
  std::error_code code = remove_drive(replaced_dir_);
  std::error_code absent;
  if (!code && fs::exists(final_dir_, absent)) {
    fs::rename(final_dir_, replaced_dir_, code);
  }
  if (!code) {
    fs::rename(sequence_dir_ / kPoses, final_poses_, code);
  }
  if (!code) {
    fs::rename(sequence_dir_, final_dir_, code);
  }
  if (!code) {
    code = remove_drive(replaced_dir_);
  }
  return code ? Status(cannot("replace the drive", final_dir_, code)) : Status();
}

Status DriveFolder::write_image(std::size_t index, const cv::Mat& rgb) const {
  const fs::path file = sequence_dir_ / "image_2" / fmt::format("{:06}.png", index);
  // Noise does not compress: the fastest level costs a few per cent of size.
  return write_text_file(file, io::encode_png(rgb, true));
}

Status DriveFolder::write_depth(std::size_t index, const cv::Mat& depth_m) const {
  static_assert(std::endian::native == std::endian::little, "the header says '<f4'");
  STEMVO_CHECK(depth_m.type() == CV_32FC1 && depth_m.isContinuous(), "depth is one float plane");
  const std::string header =
      fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", depth_m.rows,
                  depth_m.cols);
  // Magic, version and the length of the header, which fills 128 bytes with them and a newline.
  std::string bytes("\x93NUMPY\x01\x00\x76\x00", 10);
  bytes += fmt::format("{:117}\n", header);
  bytes.append(reinterpret_cast<const char*>(depth_m.data), depth_m.total() * sizeof(float));
  return write_text_file(sequence_dir_ / "depth" / fmt::format("{:06}.npy", index), bytes);
}

Status DriveFolder::write_calibration(const Camera& camera) const {
  std::string text;
  for (int i = 0; i < 4; ++i) {
    text += fmt::format("P{}: {:.12e} 0 {:.12e} 0 0 {:.12e} {:.12e} 0 0 0 1 0\n", i, camera.fx_px,
                        camera.cx_px, camera.fy_px, camera.cy_px);
  }
  return write_text_file(sequence_dir_ / "calib.txt", text);
}

Status DriveFolder::write_camera_file(const Camera& camera, double rate_hz) const {
  return write_text_file(
      sequence_dir_ / "camera.yaml",
      fmt::format("image_width: {}\nimage_height: {}\ncamera_model: pinhole\n"
                  "intrinsics: [{}, {}, {}, {}]\n"
                  "distortion_model: none\ndistortion_coefficients: []\nrate_hz: {}\n",
                  camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px,
                  camera.cy_px, rate_hz));
}

Status DriveFolder::write_truth(std::span<const Rigid3> world_from_camera, double rate_hz) const {
  const int digits = rate_hz == 10.0 ? 6 : 12;  // KITTI's own number of digits where it is exact
  std::string times;
  std::string poses;
  for (std::size_t i = 0; i < world_from_camera.size(); ++i) {
    times += fmt::format("{:.{}e}\n", static_cast<double>(i) / rate_hz, digits);
    const Matrix34d m = i == 0
                            ? Rigid3().matrix()
                            : (world_from_camera.front().inverse() * world_from_camera[i]).matrix();
    for (int k = 0; k < 12; ++k) {
      poses += fmt::format("{:.16e}{}", m(k / 4, k % 4), k == 11 ? '\n' : ' ');
    }
  }
  return write_text_file(sequence_dir_ / "times.txt", times).and_then([&] {
    return write_text_file(sequence_dir_ / kPoses, poses);
  });
}

}  // namespace stemvo::synth
