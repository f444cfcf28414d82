// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include <opencv2/core/mat.hpp>

#include "pipeline/out_folder.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo::synth {

/// OUT/sequences/NAME and OUT/poses in KITTI's layout. Everything is made beside them, and takes
/// their names when it is whole. Every Error names the file.
class DriveFolder {
 public:
  DriveFolder(const std::filesystem::path& out_dir, const std::string& name);

  /// Makes the folders, for one process at a time. Error: what is there was not rendered.
  [[nodiscard]] Expected<pipeline::FolderLock> prepare(bool with_depth) const;
  [[nodiscard]] bool has_earlier() const;
  /// Leaves an earlier drive as it is.
  [[nodiscard]] Status abandon() const;
  /// In place of an earlier drive.
  [[nodiscard]] Status finish() const;
  /// image_2/%06d.png. May be called from several threads for different frames.
  [[nodiscard]] Status write_image(std::size_t index, const cv::Mat& rgb) const;
  /// depth/%06d.npy: NumPy format 1.0, little-endian float32, rows first; metres along z.
  [[nodiscard]] Status write_depth(std::size_t index, const cv::Mat& depth_m) const;
  /// calib.txt with the same intrinsics in P0 to P3, no baseline.
  [[nodiscard]] Status write_calibration(const Camera& camera) const;
  /// camera.yaml beside calib.txt, for sources that read a folder of images.
  [[nodiscard]] Status write_camera_file(const Camera& camera, double rate_hz) const;
  /// times.txt and the poses, moved so that the first pose is the identity; 17 digits.
  [[nodiscard]] Status write_truth(std::span<const Rigid3> world_from_camera, double rate_hz) const;

 private:
  /// Error: something there was not rendered.
  [[nodiscard]] Status check_final_names() const;
  /// Error: one was edited.
  [[nodiscard]] Status check_texts() const;
  [[nodiscard]] Status mark_texts() const;
  /// In place of an unfinished drive.
  [[nodiscard]] Status make_folders(bool with_depth) const;

  std::filesystem::path sequence_dir_;  ///< while it is made, with the poses in it: NAME.unfinished
  std::filesystem::path final_dir_;
  std::filesystem::path replaced_dir_;  ///< the drive before, while it goes
  std::filesystem::path final_poses_;
};

}  // namespace stemvo::synth
