// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"
#include "stemvo/evaluation/trajectory.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo::synth {

/// OUT/sequences/NAME and OUT/poses in KITTI's layout. Every Error names the file.
class DriveWriter {
 public:
  /// Makes the folders and removes the frames and the camera file of an earlier drive: a longer one
  /// would leave images without times and poses behind.
  [[nodiscard]] static Expected<DriveWriter> create(const std::filesystem::path& out_dir,
                                                    const std::string& name,
                                                    bool with_depth);

  /// image_2/%06d.png. May be called from several threads for different frames.
  [[nodiscard]] Status write_image(std::size_t index, const cv::Mat& bgr) const;
  /// depth/%06d.npy: NumPy format 1.0, little-endian float32, rows first; metres along z.
  [[nodiscard]] Status write_depth(std::size_t index, const cv::Mat& depth_m) const;
  /// calib.txt with the same intrinsics in P0 to P3, no baseline.
  [[nodiscard]] Status write_calibration(const Camera& camera) const;
  /// camera.yaml beside calib.txt, for sources that read a folder of images.
  [[nodiscard]] Status write_camera_file(const Camera& camera, double rate_hz) const;
  /// times.txt and poses/NAME.txt, moved so that the first pose is the identity; 17 digits.
  [[nodiscard]] Status write_truth(std::span<const Rigid3> world_from_camera, double rate_hz) const;

 private:
  std::filesystem::path sequence_dir_;
  std::filesystem::path pose_file_;
};

}  // namespace stemvo::synth
