// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "odometry/road/belief.hpp"
#include "odometry/road/image.hpp"
#include "odometry/road/model.hpp"
#include "odometry/scale_filter.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// The road's part in the scale after a frame; nothing of it looks ahead.
struct RoadScaleEstimate {
  bool is_believed = false;  ///< it is the road; else the scale is a guess
  bool is_measured = false;  ///< this frame's road was measured and believed
  /// What this frame's road says, log(metres per unit) and its sigma; nullopt: nothing.
  std::optional<std::pair<double, double>> log_scale;
  std::string_view reason = "";  ///< where is_measured is false
};

/// Metres per unit of a monocular odometry from the road: joins the estimators, and frames.
class RoadScale {
 public:
  explicit RoadScale(const RoadOptions& options) : options_(options) {}

  /// One call per frame with an image. `cur_from_prev`: the motion since the
  /// last call, in units of the map (ignored at the first call and after restart()). The filter
  /// says what is known now, and takes what is measured. The landmarks, in the current camera, are
  /// witnesses of what is measured.
  RoadScaleEstimate update(RoadImage image,
                           const Rigid3& cur_from_prev,
                           ScaleFilter& filter,
                           const std::vector<RoadLandmark>& landmarks = {});
  /// The sigma of log(metres per unit) by this filter: unknown while no road is believed.
  [[nodiscard]] double sigma(const ScaleFilter& filter) const {
    const double sigma = belief_.sigma_factor() * filter.sigma();
    return belief_.is_believed() ? std::min(ScaleFilter::kUnknownSigma, sigma)
                                 : ScaleFilter::kUnknownSigma;
  }
  /// The map was multiplied by `factor` (new units = factor * old units).
  void rescale(double factor) {
    for (Eigen::Vector3d& position : path_) {
      position *= factor;
    }
    for (Past& past : past_) {
      past.now_from_past.translation *= factor;
    }
  }
  /// Nothing connects the next frame with the ones before (lost, cut): units may be different ones.
  void restart() {
    belief_.restart();
    past_.clear();
    path_.clear();
    frames_unmeasured_ = 0;
  }

 private:
  struct Past {
    RoadImage image;
    Rigid3 now_from_past;
  };
  /// The nearest past frame that is far enough away; nullptr where the car did not move.
  [[nodiscard]] const Past* pick_past(const ScaleFilter& filter) const;
  [[nodiscard]] RoadPrior make_prior(const Rigid3& motion, const ScaleFilter& filter) const;
  /// Fills slope, drop and their information: y = y0 + slope z + drop / height z^2 through the
  /// path, y0: the current vertical bounce.
  void predict_profile(double metres_per_unit, RoadPrior& prior) const;
  void remember(RoadImage image) {
    past_.push_front({std::move(image), Rigid3{}});
    if (past_.size() > static_cast<std::size_t>(std::max(1, options_.max_frames_apart))) {
      past_.pop_back();
    }
  }
  /// Both estimators, joined and given to the filter.
  RoadScaleEstimate measure(const Past& past,
                            const RoadImage& image,
                            ScaleFilter& filter,
                            const std::vector<RoadLandmark>& landmarks);
  /// Counts the landmarks seen through the strip of `road`.
  void count(const std::vector<RoadLandmark>& landmarks,
             const Rigid3& motion,
             const RoadPrior& road,
             RoadEvidence& evidence) const;

  RoadOptions options_;
  /// The way that the camera came, in the current camera, map units; newest first. It lies above
  /// the road at the camera's height, but for the car's bouncing, and tells the slope and the bend
  /// of the road under the car, whatever the camera's pitch. Without it a crest ahead looks like a
  /// larger step (the plane through the road ahead passes closer under the camera than the road
  /// does): 1 mrad of bend between car and strip is 0.3 % of scale.
  std::deque<Eigen::Vector3d> path_;
  RoadBelief belief_;
  std::deque<Past> past_;  ///< newest first
  int frames_unmeasured_ = 0;
};

}  // namespace stemvo
