// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace stemvo::calibration {

/// Where a patch of one picture lies in another: centre and the linear part of the affine map.
struct PatchPlace {
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();  ///< pixels of the picture
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();
};

struct PatchOptions {
  int half_window = 6;  ///< pixels
  int max_iterations = 20;
  double converged_px = 0.005;
  double max_shift_px = 2.0;  ///< from the start
  double max_rms = 0.35;      ///< of the residual, in standard deviations of the patch
};

/// A patch to be found in other pictures: affine Lucas-Kanade with gain and offset, inverse
/// compositional (Baker and Matthews, IJCV 2004), Gaussian weights. Frame-to-frame tracking adds up
/// its errors; patches that are all held against one do not.
class Patch {
 public:
  /// `picture` CV_8UC1; nullopt where the window leaves it or has no texture.
  [[nodiscard]] static std::optional<Patch> cut(const cv::Mat& picture,
                                                const Eigen::Vector2d& uv,
                                                const PatchOptions& options = {});
  /// From a start that is off by a pixel or two. nullopt: did not converge, left the picture, or
  /// does not look alike.
  [[nodiscard]] std::optional<PatchPlace> find(const cv::Mat& picture,
                                               const PatchPlace& start) const;

 private:
  static constexpr int kNumParameters = 8;  ///< 4 of the linear part, 2 of the shift, gain, offset
  using Normal = Eigen::Matrix<double, kNumParameters, kNumParameters>;
  explicit Patch(const PatchOptions& options) : options_(options) {}

  PatchOptions options_;
  Eigen::VectorXd values_;                                          ///< mean 0, deviation 1
  Eigen::VectorXd weights_;                                         ///< sum 1
  Eigen::Matrix<double, Eigen::Dynamic, kNumParameters> steepest_;  ///< weighted
  Normal inverse_;
};

}  // namespace stemvo::calibration
