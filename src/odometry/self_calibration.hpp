// SPDX-License-Identifier: MIT
#pragma once

#include <iterator>
#include <optional>

#include <Eigen/Core>

#include "geometry/bundle.hpp"
#include "odometry/bundle_adjustment.hpp"
#include "odometry/window.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Learns the camera from runs of keyframes, one after the other: principal point, focal length and
/// the radial distortion that is left, each with a prior. The given camera is left only where the
/// data insist.
class SelfCalibration {
 public:
  /// Of a run. Fewer do not tell the principal point from the distortion: 6 find -8 px on a clip
  /// where 8 and 12 find -3 px +- 1.1, and 16 -2.8 +- 0.8.
  static constexpr int kNumKeyframes = 16;

  SelfCalibration(const Camera& given, CameraRefinement refinement);

  /// The next keyframe, its pose refined. A run that is long enough is measured, and the next one
  /// begun.
  void observe(const Keyframe& keyframe, const BundleAdjustmentOptions& options);
  /// As of a window.
  void rescale(double factor, const Eigen::Vector3d& center) {
    stemvo::rescale(run_, factor, center);
  }
  /// The keyframes that come are of another map.
  void restart() { run_ = {}; }

  /// The given one, or on its way to what the data insist on.
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// What all runs say, whether the data insist on it or not; nullopt: nothing is refined.
  [[nodiscard]] std::optional<CameraEstimate> estimate() const;
  /// Of the estimate; nullopt: nothing is refined.
  [[nodiscard]] std::optional<Eigen::Vector2d> principal_point_sigma_px() const;

  /// Its state, for state_archive.hpp.
  template <typename Archive>
  void serialize(Archive& archive) {
    archive(camera_, believed_, mean_, information_, num_runs_, run_);
  }
  /// When it was read.
  [[nodiscard]] bool is_sound() const {
    constexpr int kMaxRuns = 1 << 30;
    return camera_.width_px == given_.width_px && camera_.height_px == given_.height_px &&
           num_runs_ >= 0 && num_runs_ <= kMaxRuns && std::ssize(run_.keyframes) < kNumKeyframes;
  }

 private:
  void measure(const BundleAdjustmentOptions& options);
  void approach_believed();
  [[nodiscard]] CameraChange applied() const;

  Camera given_;
  Camera camera_;
  CameraRefinement refinement_;
  CameraChange believed_ = CameraChange::Zero();  ///< what the data insist on; camera_ goes there
  CameraChange mean_ = CameraChange::Zero();      ///< less the given camera
  CameraInformation information_;
  int num_runs_ = 0;  ///< measured
  Window run_;        ///< the keyframes since the last measurement
};

}  // namespace stemvo
