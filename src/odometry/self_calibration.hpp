// SPDX-License-Identifier: MIT
#pragma once

#include <future>
#include <optional>

#include <Eigen/Core>

#include "geometry/bundle.hpp"
#include "geometry/radial_lens.hpp"
#include "mapping/kept_map.hpp"
#include "odometry/window.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Standard deviations of what is known of a given camera beforehand; nullopt: it is right.
[[nodiscard]] std::optional<IntrinsicsDelta> prior_sigma(CameraRefinement refinement);

/// Learns the camera from runs of keyframes, one after the other: principal point, focal length and
/// the radial distortion that is left, each with a prior. The given camera is changed only
/// where the data are significant (> 2 sigma).
class SelfCalibration {
 public:
  /// Keyframes of a run. Fewer do not tell the principal point from the distortion: 6 find -8 px on
  /// a clip where 8 and 12 find -3 px +- 1.1, and 16 -2.8 +- 0.8.
  static constexpr int kNumKeyframes = 16;

  SelfCalibration(const Camera& given, CameraRefinement refinement, bool may_begin_threads = true);

  /// Before the first keyframe: the lens that an earlier recording learnt, where its camera is much
  /// the same.
  void begin_with(const KeptKeyframe& of_map);
  /// Takes the next keyframe, refined where the window is. A run that is long enough is measured
  /// until the next call, in another thread where it may begin one,
  /// and taken in then: the same on any number of threads.
  /// `radial`: of the lens that the keyframe's pixels were freed of.
  void observe(const Keyframe& keyframe,
               const Eigen::Vector2d& radial,
               const BundleOptions& options);
  void rescale(double factor, const Eigen::Vector3d& center) {
    stemvo::rescale(run_, factor, center);
  }
  /// The following keyframes belong to a new map.
  void restart() { run_ = {}; }

  /// The given one, or on its way to the target.
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// The distortion that is left, or on its way to the target.
  [[nodiscard]] RadialLens lens() const { return radial_lens(camera_, radial_); }
  [[nodiscard]] const Eigen::Vector2d& radial() const { return radial_; }
  /// The estimate of all runs, whether it is significant or not, after one that is still measured;
  /// nullopt: nothing is refined.
  [[nodiscard]] std::optional<CameraEstimate> estimate() const {
    if (refinement_ == CameraRefinement::kOff) {
      return std::nullopt;
    }
    SelfCalibration after = *this;
    after.fuse_result();
    return CameraEstimate{after.mean_, after.sigma(), after.num_runs_};
  }
  /// Standard deviations after the runs fused so far; nullopt: nothing is refined.
  [[nodiscard]] std::optional<CameraSigma> camera_sigma() const {
    if (refinement_ == CameraRefinement::kOff) {
      return std::nullopt;
    }
    const IntrinsicsDelta sigmas = sigma();
    return CameraSigma{sigmas[2] * given_.fx_px, sigmas[0], sigmas[1]};
  }

 private:
  using Measured = std::shared_future<std::optional<CameraMeasurement>>;

  void begin_measuring(const BundleOptions& options);
  /// The run that is measured, if there is one; waits for it.
  void fuse_result();
  void approach_target();
  /// Pixels that were freed of another lens are freed of lens().
  void free_again(const RadialLens& before, Observations& points) const;
  /// A pixel at the image's side is moved by so much, px, for k1 and k2 of 1.
  [[nodiscard]] Eigen::Vector2d side_px() const;
  [[nodiscard]] IntrinsicsDelta applied() const {
    IntrinsicsDelta change = IntrinsicsDelta::Zero();
    change[0] = camera_.cx_px - given_.cx_px;
    change[1] = camera_.cy_px - given_.cy_px;
    change[2] = camera_.fx_px / given_.fx_px - 1.0;
    change.tail<2>() = radial_;
    return change;
  }
  /// Standard deviations of mean_.
  [[nodiscard]] IntrinsicsDelta sigma() const;

  Camera given_;
  Camera camera_;
  Eigen::Vector2d radial_ = Eigen::Vector2d::Zero();  ///< k1, k2
  CameraRefinement refinement_;
  bool may_begin_threads_;
  IntrinsicsDelta target_ =
      IntrinsicsDelta::Zero();  ///< significant part of mean_; camera_ goes there
  IntrinsicsDelta mean_ = IntrinsicsDelta::Zero();  ///< relative to the given camera
  CameraInformation information_;
  int num_runs_ = 0;   ///< measured
  Window run_;         ///< the keyframes since the last one that was measured
  Measured measured_;  ///< that run; not valid once it was taken in
};

}  // namespace stemvo
