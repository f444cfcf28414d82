// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "mapping/mapper.hpp"
#include "odometry/estimator.hpp"
#include "odometry/initializer.hpp"
#include "odometry/localization.hpp"
#include "odometry/metric_scale.hpp"
#include "odometry/motion_covariance.hpp"
#include "odometry/motion_model.hpp"
#include "odometry/moving_things.hpp"
#include "odometry/self_calibration.hpp"
#include "odometry/window.hpp"
#include "odometry/window_history.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/options.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// FrameResult::map_id.
class MapIds {
 public:
  /// The map of the frame in work.
  [[nodiscard]] int now() const { return now_; }
  void begin() { now_ = num_maps_++; }
  /// The camera is in the map of an earlier frame; one below 0 is another recording's.
  void go_back_to(int frame) { now_ = of(frame); }
  /// The map is joined to that of an earlier frame.
  void join(int frame) {
    const int joined = of(frame);
    std::ranges::replace(of_frame_, now_, joined);
    now_ = joined;
  }
  void end_frame() { of_frame_.push_back(now_); }

 private:
  [[nodiscard]] int of(int frame) const {
    return frame < 0 ? -1 : of_frame_[static_cast<std::size_t>(frame)];
  }

  int now_ = 0;
  int num_maps_ = 0;
  std::vector<int> of_frame_;
};

/// The last frame of a stand, which becomes a keyframe when the camera moves off.
struct Stand {
  int frame = -1;       ///< below 0: there was none
  Observations points;  ///< empty: they are a keyframe's
  int keyframe = -1;    ///< frame of the last stand that became one
};

/// The estimator (`odometry.mode: map`): a window of keyframes is the truth, and a frame is
/// localized against its landmarks. It alone owns pose, window, scale and camera
/// (docs/architecture.md).
class WindowEstimator final : public Estimator {
 public:
  WindowEstimator(const Options& config, const Camera& camera);

  [[nodiscard]] LocalizedFrame localize(const Frame& frame) override;
  void optimize(const Frame& frame, LocalizedFrame& localized) override;

  [[nodiscard]] LandmarkChanges landmarks_since(int version) const override {
    return history_.changes_since(version, window_);
  }
  [[nodiscard]] std::span<const int> keyframes() const override { return history_.keyframes(); }

  void load_map(KeptMap map) override {
    if (!map.keyframes.empty()) {
      calibration_.begin_with(map.keyframes.back());
    }
    mapper_.load(std::move(map));
  }
  [[nodiscard]] KeptMap kept_map() const override { return mapper_.map(window_view()); }
  [[nodiscard]] std::optional<CameraEstimate> camera_estimate() const override {
    return calibration_.estimate();
  }

  [[nodiscard]] RadialLens lens() const override { return calibration_.lens(); }

  [[nodiscard]] const Window& window() const { return window_; }

 private:
  // Localization: what gives the frame its pose and its state.
  FrameState find_pose(const Frame& frame, LocalizedFrame& localized);
  /// `still_px`: the flow of tracks that stay where they were, of stationary_flow_px().
  FrameState accept_localization(const Frame& frame,
                                 const Rigid3& found,
                                 const std::optional<double>& still_px,
                                 LocalizedFrame& localized);
  /// Share of the image's cells whose matches since the last frame fit a motion well.
  [[nodiscard]] double share_that_fits(const Rigid3& cur_from_last,
                                       const Matches& matches,
                                       const std::vector<char>& mask) const;
  /// Behind the pose found may be a thing that moves on its own. Where another pose fits the world
  /// better this is returned, and the thing's tracks are moving_ and not in the mask; else `found`.
  [[nodiscard]] Rigid3 pose_without_thing(const Frame& frame,
                                          const SeenLandmarks& seen,
                                          const Rigid3& found,
                                          std::vector<char>& mask);
  /// By landmarks: what is far must turn as the near ones say.
  [[nodiscard]] std::optional<Localization> localize_by_near(const SeenLandmarks& seen,
                                                             const Rigid3& found,
                                                             const Matches& matches,
                                                             std::vector<char>& thing) const;
  /// The pose found is that before a thing which moves on its own: for some frames it has fitted
  /// that alone, and another motion the rest of the image.
  [[nodiscard]] bool is_map_of_thing(const Rigid3& found,
                                     const Matches& matches,
                                     const std::vector<char>& mask);
  void fuse_with_prediction(const Rigid3& before,
                            const SeenLandmarks& seen,
                            double parallax,
                            const std::optional<double>& still_px);
  /// The turn since the frame before, where the images as a whole tell it.
  [[nodiscard]] std::optional<Eigen::Quaterniond> image_turn(const Frame& frame) const {
    return last_.frame == frame.number - 1 ? frame.image_turn : std::nullopt;
  }
  /// Nothing is measured: the last motion goes on, with the turn that anything tells.
  void go_on(const Frame& frame) {
    const std::optional<Eigen::Quaterniond> hint = trust_.trusted(frame.hints);
    world_from_camera_ = predict(hint ? hint : image_turn(frame));
  }
  /// Goes on in the map where the frame shows a kept place; false: it shows none.
  [[nodiscard]] Rigid3 pose_by_reference(const Matches& matches,
                                         const std::map<int, Eigen::Vector3d>& in_camera,
                                         const Rigid3& predicted) const;
  [[nodiscard]] bool relocate(const Frame& frame, const Observations& now, const Rigid3& predicted);
  FrameState begin_anew(const Frame& frame, LocalizedFrame& localized);
  FrameState measure_since_reference(const Frame& frame,
                                     const Observations& now,
                                     LocalizedFrame& localized);
  FrameState accept_motion(const Frame& frame,
                           const MeasuredMotion& motion,
                           LocalizedFrame& localized);

  // A camera that stood moves off.
  static constexpr double kHidden_s = 3.0;  ///< it is believed to stand where things hide the world
  [[nodiscard]] const Keyframe* stand_keyframe() const;
  void renew_stand(const Observations& now);
  void renew_stand_behind(const Frame& frame, const Observations& now);
  void keep_stand();
  [[nodiscard]] int num_standing(const Frame& frame, const Observations& now) const;
  [[nodiscard]] const Keyframe* standing_keyframe(const Frame& frame,
                                                  const Observations& now) const;
  [[nodiscard]] std::optional<double> length_since_stand(const Observations& now,
                                                         const Rigid3& cur_from_stand) const;

  /// The pose if the last motion goes on. `turned`: its rotation, where that is known.
  [[nodiscard]] Rigid3 predict(const std::optional<Eigen::Quaterniond>& turned = {}) const {
    return world_from_camera_ * motion_.predict(interval_s_, turned);
  }
  /// The frame in work was placed in the map.
  [[nodiscard]] bool is_localized(const Frame& frame) const {
    return frame.has_image() && view_.frame == frame.number;
  }
  /// Matches with the frame before, which has a pose of this map.
  [[nodiscard]] bool is_since_last(const Matches& matches) const {
    return is_last_localized_ && matches.prev_frame == last_.frame;
  }
  [[nodiscard]] bool has_had_map() const { return !history_.keyframes().empty(); }
  void reset_reference(View reference);
  [[nodiscard]] bool open_window(const View& view);
  void close_window();
  [[nodiscard]] WindowView window_view() const {
    return {window_,     history_, camera(),      radials_,
            trajectory_, times_s_, metric_sigma_, view_.frame};
  }
  [[nodiscard]] MotionCovariance::InMap in_map() const {
    return {window_, world_from_camera_, trajectory_.back(), camera(), localization_.loss_px};
  }
  /// The camera in use: SelfCalibration owns it, everything else takes it as an argument.
  [[nodiscard]] const Camera& camera() const { return calibration_.camera(); }
  /// Least flow that counts as motion.
  [[nodiscard]] double min_flow_px() const;
  /// Least parallax that does: the position is measured well.
  [[nodiscard]] double min_way_px() const;
  /// Matches that do not fit the pose: far from their landmark, or from their epipolar line.
  void mark_outliers(const Matches& matches, double bound_px, std::vector<char>& mask) const;

  // After localization.
  [[nodiscard]] bool is_keyframe(const View& view) const;
  void add_keyframe(const Frame& frame);
  /// A full window first drops its leaving keyframe.
  void append(Keyframe keyframe);
  /// A keyframe of the window, which the map keeps, is dropped for the one that comes.
  void leave(std::size_t leaving, const Keyframe& coming);
  /// An old place was recognized: the window keeps to it.
  void take_in(const Recognition& recognition);
  /// Units of motion that move the median landmark in view by a pixel.
  [[nodiscard]] double pixel_units(const SeenLandmarks& seen) const;
  void measure_scale(const Frame& frame, FrameState state);
  void describe(const Frame& frame, FrameResult& result);
  void measure_covariance(const Frame& frame, LocalizedFrame& localized);
  void remember(const Frame& frame, FrameState state);

  OdometryOptions options_;
  WindowOptions window_options_;
  BundleOptions refinement_;
  LocalizationOptions localization_;
  int refine_every_;
  double keyframe_parallax_px_;

  Initializer initializer_;
  MovingTracks moving_;
  bool is_initializing_ = true;
  Window window_;  ///< initializing: empty, or one that was lost and may be seen again
  WindowHistory history_;
  MapIds map_ids_;
  Mapper mapper_;
  MetricScale scale_;
  SelfCalibration calibration_;
  MotionCovariance uncertainty_;
  Rigid3 world_from_camera_;                 ///< of the frame in work
  MotionModel motion_;                       ///< between localized frames
  std::optional<MotionModel::Fused> fused_;  ///< the frame in work, where parallax is low
  double assumed_step_;  ///< in the first interval, where nothing measures a length
  std::vector<Eigen::Vector2d> radials_;  ///< of the lenses that frames' pixels were freed of
  HintTrust trust_;
  double speed_ = 0.0;       ///< of the last step measured or assumed, units per second
  double interval_s_ = 0.0;  ///< between the frame in work and the one before
  View last_;                ///< the last frame with an image, without its points
  View view_;                ///< the last frame that was localized
  View moving_view_;         ///< the last one that was not stationary
  Stand stand_;
  Eigen::Vector3d moved_to_ = Eigen::Vector3d::Zero();  ///< by the last one with parallax
  Rigid3 road_pose_;                    ///< of the last frame whose road was measured
  bool is_last_localized_ = false;      ///< last_ has a pose that was measured
  bool was_static_ = false;             ///< the last image did not show new motion
  bool stood_ = false;                  ///< as was the last frame that was localized
  std::optional<double> metric_sigma_;  ///< of the last frame's scale, where that is in metres
  std::optional<Similarity3> moved_;    ///< the world, on the frame in work: new from old
  int recognized_frame_ = -1;           ///< by the frame in work
  int num_taken_ = 0;                   ///< frames in a row whose map seems a thing's
  double still_s_ = 0.0;                ///< since the initializer's reference: as far as it stood
  int keyframes_since_refinement_ = 0;
};

}  // namespace stemvo
