// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "features/front_end.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

/// The turn between two images by aligning them as a whole, small and blurred: three unknowns and
/// no points, so that it is found however far the points have moved. Parallax is taken for a turn,
/// too: it says where to look, and measures nothing.
class ImageTurn {
 public:
  explicit ImageTurn(const Camera& camera) : camera_(camera) {}

  /// prev_from_cur from the image before, `interval_s` ago; `hint`: a guess of it. nullopt: no
  /// image before, of another size, plain, or of another scene.
  [[nodiscard]] std::optional<Eigen::Quaterniond> align(
      const ImagePyramid& image, double interval_s, const std::optional<Eigen::Quaterniond>& hint);
  /// The turn that align() expected of its last image: the one before went on as fast.
  [[nodiscard]] const Eigen::Quaterniond& expected() const { return expected_; }
  /// align()'s hint, or expected() without one, makes its two images much less alike than the turn
  /// it found.
  [[nodiscard]] bool refutes_guess() const { return refutes_guess_; }

  /// A small gray image and the pinhole camera that it was taken by.
  struct Level {
    cv::Mat1f pixels;  ///< NaN: behind the mask
    Eigen::Array2f focal_px;
    Eigen::Array2f center_px;
  };

 private:
  [[nodiscard]] std::vector<Level> small_levels(const ImagePyramid& image) const;

  Camera camera_;
  std::vector<Level> last_;  ///< the finest first; empty: no image yet
  Eigen::Vector3d rad_per_s_ = Eigen::Vector3d::Zero();
  Eigen::Quaterniond expected_ = Eigen::Quaterniond::Identity();
  bool refutes_guess_ = false;
};

}  // namespace stemvo
