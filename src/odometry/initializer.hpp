// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "odometry/road/image.hpp"
#include "odometry/two_view_estimator.hpp"
#include "odometry/window.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/options.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A frame as it was localized: what later ones are compared with.
struct View {
  int frame = -1;
  Rigid3 world_from_camera;
  Observations points;
  double time_s = 0.0;
  std::shared_ptr<const RoadImage> road = nullptr;  ///< null: the road is not asked, or not kept
};

/// Finds the first landmarks: the paper's H/F selection between a reference frame and the newest
/// one, once there is parallax to decide (paper section 3.5-3.6).
class Initializer {
 public:
  explicit Initializer(const Options& config) : options_(config.two_view), two_view_(config) {}

  /// The frame that the next ones are compared with. Without points: the matches of the next frame
  /// start there and say them.
  void start(View reference) { reference_ = std::move(reference); }
  [[nodiscard]] const View& reference() const { return reference_; }
  /// Too few of its tracks live: it will not decide any more.
  [[nodiscard]] bool lost_reference(const Observations& now) const;

  /// The motion from the reference to a frame. `inlier_mask` is one per match of the frame; a match
  /// that the reference does not see is kept.
  [[nodiscard]] MeasuredMotion measure(const Matches& matches,
                                       const Observations& now,
                                       const Camera& camera);

  /// The window of the reference, `now` and the landmarks that both see. `now.world_from_camera`
  /// says where it is. nullopt: too few landmarks.
  [[nodiscard]] std::optional<Window> open_window(const View& now,
                                                  const Camera& camera,
                                                  const WindowOptions& window_options) const;
  /// Covariance, as MeasuredMotion::covariance, of what points that agree do not tell of the motion
  /// that opened it.
  [[nodiscard]] Matrix6d opening_error(const MeasuredMotion& motion,
                                       const Observations& now,
                                       const Camera& camera) const;

  /// The motion of the camera, of things that move on their own told apart.
  [[nodiscard]] MeasuredMotion measure_world(const PixelPairs& pairs, const Camera& camera) const;

 private:
  /// Takes the hypothesis of either model that fits best; decisive where no other fits nearly as
  /// well.
  void choose_motion(const PixelPairs& pairs, const Camera& camera, MeasuredMotion& motion) const;

  TwoViewOptions options_;
  TwoViewEstimator two_view_;
  View reference_;
};

}  // namespace stemvo
