// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "calibration/segment.hpp"
#include "calibration/shared_camera.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo::calibration {

/// Which of the shared numbers are refined.
using SharedMask = std::array<bool, kNumShared>;
inline constexpr SharedMask kNothingFree = {false, false, false, false, false};
inline constexpr SharedMask kAllFree = {true, true, true, true, true};

struct AdjustmentOptions {
  SharedMask is_free = kAllFree;
  double loss_scale_px = 0.5;  ///< Cauchy scale on the reprojection error
  int max_iterations = 30;
  double tolerance = 1e-6;  ///< relative change of the cost
};

/// What a segment tells of the shared numbers once poses and landmarks are eliminated.
struct SegmentInformation {
  SharedMatrix hessian = SharedMatrix::Zero();  ///< of half the robust cost
  SharedVector gradient = SharedVector::Zero();
};

/// Bundle adjustment of all segments at once: poses, landmarks and the camera they share, robust
/// reprojection error, Schur complement over the landmarks, one thread. The first keyframe of a
/// segment and one coordinate of its last one hold the gauge.
class JointAdjustment {
 public:
  JointAdjustment(std::vector<Segment>& segments, const Camera& given)
      : segments_(segments), given_(given), shared_(shared_of(given)) {}

  /// Called after each iteration; false stops.
  using Callback = std::function<bool()>;
  /// Moves segments and shared numbers. False: not solvable, or stopped; they stay.
  bool solve(const AdjustmentOptions& options, const Callback& callback);

  [[nodiscard]] const SharedVector& shared() const { return shared_; }
  void set_shared(const SharedVector& shared) { shared_ = shared; }
  /// Reprojection error of an observation; infinite behind the camera.
  [[nodiscard]] double error_px(const Segment& segment,
                                const Landmark& landmark,
                                const Observation& seen) const;
  /// Here and now, one per segment.
  [[nodiscard]] std::vector<SegmentInformation> information(double loss_scale_px);

 private:
  std::vector<Segment>& segments_;
  Camera given_;
  SharedVector shared_;
};

}  // namespace stemvo::calibration
