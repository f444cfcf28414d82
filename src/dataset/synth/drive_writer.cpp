// SPDX-License-Identifier: MIT
#include "dataset/synth/drive_writer.hpp"

#include <bit>
#include <fstream>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>

#include "stemvo/check.hpp"

namespace stemvo::synth {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCameraFile = "camera.yaml";

Status make_folder(const fs::path& folder) {
  std::error_code code;
  fs::create_directories(folder, code);
  if (code || !fs::is_directory(folder, code)) {
    return fail(fmt::format("{}: expected a folder that can be made, found: {}", folder.string(),
                            code ? code.message() : "something that is no folder"));
  }
  return {};
}

Status remove_file(const fs::path& file) {
  std::error_code code;
  fs::remove(file, code);
  if (code) {
    return fail(fmt::format("{}: cannot replace the file: {}", file.string(), code.message()));
  }
  return {};
}

Status remove_frames(const fs::path& folder, const std::string& extension) {
  std::error_code code;
  std::vector<fs::path> old;
  for (fs::directory_iterator entry(folder, code), end; !code && entry != end;
       entry.increment(code)) {
    const std::string stem = entry->path().stem().string();
    if (entry->path().extension() == extension && stem.size() == 6 &&
        stem.find_first_not_of("0123456789") == std::string::npos) {
      old.push_back(entry->path());
    }
  }
  for (const fs::path& file : old) {
    if (const Status removed = remove_file(file); !removed) {
      return removed;
    }
  }
  return {};
}

Status write_file(const fs::path& file, const void* data, std::size_t size) {
  std::ofstream stream(file, std::ios::binary);
  stream.write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
  stream.close();
  if (!stream) {
    return fail(fmt::format("{}: cannot write the file", file.string()));
  }
  return {};
}

Status write_text(const fs::path& file, const std::string& text) {
  return write_file(file, text.data(), text.size());
}

}  // namespace

Expected<DriveWriter> DriveWriter::create(const fs::path& out_dir,
                                          const std::string& name,
                                          bool with_depth) {
  DriveWriter writer;
  writer.sequence_dir_ = out_dir / "sequences" / name;
  writer.pose_file_ = out_dir / "poses" / (name + ".txt");
  const fs::path images = writer.sequence_dir_ / "image_2";
  const fs::path depth = writer.sequence_dir_ / "depth";
  std::vector<fs::path> folders = {images, out_dir / "poses"};
  if (with_depth) {
    folders.push_back(depth);
  }
  for (const fs::path& folder : folders) {
    if (const Status made = make_folder(folder); !made) {
      return fail(made.error().message);
    }
  }
  for (const auto& [folder, extension] : {std::pair(images, ".png"), std::pair(depth, ".npy")}) {
    if (const Status removed = remove_frames(folder, extension); !removed) {
      return fail(removed.error().message);
    }
  }
  if (const Status removed = remove_file(writer.sequence_dir_ / kCameraFile); !removed) {
    return fail(removed.error().message);
  }
  return writer;
}

Status DriveWriter::write_image(std::size_t index, const cv::Mat& bgr) const {
  const fs::path file = sequence_dir_ / "image_2" / fmt::format("{:06}.png", index);
  std::vector<uchar> bytes;
  // Noise does not compress: the fastest level costs a few per cent of size.
  if (!cv::imencode(".png", bgr, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1})) {
    return fail(fmt::format("{}: cannot encode the image", file.string()));
  }
  return write_file(file, bytes.data(), bytes.size());
}

Status DriveWriter::write_depth(std::size_t index, const cv::Mat& depth_m) const {
  static_assert(std::endian::native == std::endian::little, "the header says '<f4'");
  STEMVO_CHECK(depth_m.type() == CV_32FC1 && depth_m.isContinuous(), "depth is one float plane");
  std::string header =
      fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", depth_m.rows,
                  depth_m.cols);
  constexpr std::size_t kPreamble = 10;
  while ((kPreamble + header.size() + 1) % 64 != 0) {
    header += ' ';
  }
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() & 0xffU);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(depth_m.data), depth_m.total() * sizeof(float));
  return write_text(sequence_dir_ / "depth" / fmt::format("{:06}.npy", index), bytes);
}

Status DriveWriter::write_calibration(const Camera& camera) const {
  std::string text;
  for (int i = 0; i < 4; ++i) {
    text += fmt::format("P{}: {:.12e} 0 {:.12e} 0 0 {:.12e} {:.12e} 0 0 0 1 0\n", i, camera.fx_px,
                        camera.cx_px, camera.fy_px, camera.cy_px);
  }
  return write_text(sequence_dir_ / "calib.txt", text);
}

Status DriveWriter::write_camera_file(const Camera& camera, double rate_hz) const {
  return write_text(
      sequence_dir_ / kCameraFile,
      fmt::format("image_width: {}\nimage_height: {}\ncamera_model: pinhole\n"
                  "intrinsics: [{}, {}, {}, {}]\n"
                  "distortion_model: none\ndistortion_coefficients: []\nrate_hz: {}\n",
                  camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px,
                  camera.cy_px, rate_hz));
}

Status DriveWriter::write_truth(std::span<const Rigid3> world_from_camera, double rate_hz) const {
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
  if (const Status written = write_text(sequence_dir_ / "times.txt", times); !written) {
    return written;
  }
  return write_text(pose_file_, poses);
}

}  // namespace stemvo::synth
