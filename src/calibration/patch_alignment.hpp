// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace stemvo::calibration {

/// Where a patch of one image lies in another: centre and the linear part of the affine map.
struct PatchPose {
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();  ///< pixels of the image
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();
};

/// A patch to be found in other images: affine Lucas-Kanade with gain and offset, inverse
/// compositional (Baker and Matthews, IJCV 2004), Gaussian weights. Frame-to-frame tracking adds up
/// its errors; patches that are all held against one do not.
class Patch {
 public:
  /// `image` CV_8UC1; nullopt where the window leaves it or has no texture.
  [[nodiscard]] static std::optional<Patch> cut(const cv::Mat& image, const Eigen::Vector2d& uv);
  /// From a start that is off by a pixel or two. nullopt: did not converge, left the image, or
  /// does not look alike.
  [[nodiscard]] std::optional<PatchPose> find(const cv::Mat& image, const PatchPose& start) const;

 private:
  static constexpr int kNumParameters = 8;  ///< 4 of the linear part, 2 of the shift, gain, offset

  Eigen::VectorXd values_;                                          ///< mean 0, deviation 1
  Eigen::VectorXd weights_;                                         ///< sum 1
  Eigen::Matrix<double, Eigen::Dynamic, kNumParameters> steepest_;  ///< weighted
  Eigen::Matrix<double, kNumParameters, kNumParameters> inverse_;
};

}  // namespace stemvo::calibration
