// SPDX-License-Identifier: MIT
#pragma once

#include "geometry/alignment.hpp"
#include "odometry/estimator.hpp"
#include "odometry/road/image.hpp"
#include "stemvo/options.hpp"
#include "support/synthetic_drive_tracks.hpp"
#include "support/test.hpp"

namespace stemvo::testing {

/// Defaults without a road: a step that nothing measures is one unit.
inline Options config_without_scale(OdometryMode mode = OdometryMode::kMap) {
  Options config;
  config.odometry.mode = mode;
  config.scale.source = ScaleSource::kNone;
  return config;
}

/// Feeds an estimator with a drive's tracks, as a front end does: a track that it rejects ends, and
/// its point is found again under another number.
class EstimatorRun {
 public:
  EstimatorRun(Estimator& estimator, const DriveTracks& drive)
      : image(drive.camera.height_px, drive.camera.width_px, CV_8UC1, cv::Scalar(127)),
        estimator_(estimator),
        drive_(drive) {}

  /// The next frame, which shows what the drive's frame `i` does.
  FrameResult add(int i) {
    return add_matches(last_ < 0 ? Matches() : drive_.matches(last_, i), i);
  }
  /// Frames [from, to) of the drive.
  void add_range(int from, int to) {
    for (int i = from; i < to; ++i) {
      add(i);
    }
  }
  void add_all() { add_range(0, drive_.num_frames()); }
  /// A frame with these matches in place of the drive's own.
  FrameResult add_matches(Matches matches, int i) {
    Frame frame = next_frame();
    frame.image = image;
    frame.road = road ? road(i) : nullptr;
    frame.pyramid = pyramid ? pyramid(i) : nullptr;
    frame.image_turn = image_turn;
    frame.matches = std::move(matches);
    frame.matches.prev_frame = last_number_;
    const std::vector<int> points = frame.matches.track_ids;
    for (int& id : frame.matches.track_ids) {
      id += kManyTracks * num_rejected_[id];
    }
    LocalizedFrame localized = estimator_.localize(frame);
    inlier_mask = kept_tracks(localized);
    point_ids = points;
    for (std::size_t k = 0; k < inlier_mask.size(); ++k) {
      num_rejected_[points[k]] += inlier_mask[k] == 0 ? 1 : 0;
    }
    estimator_.optimize(frame, localized);
    last_ = i;
    last_number_ = frame.number;
    results.push_back(localized.result);
    return results.back();
  }
  FrameResult add_missing() {
    const Frame frame = next_frame();
    LocalizedFrame localized = estimator_.localize(frame);
    estimator_.optimize(frame, localized);
    results.push_back(localized.result);
    return results.back();
  }

  [[nodiscard]] FrameState state(int i) const { return results[static_cast<std::size_t>(i)].state; }
  [[nodiscard]] int count(FrameState state) const {
    return static_cast<int>(std::ranges::count(results, state, &FrameResult::state));
  }

  double interval_s = 0.1;                                    ///< before the next frame
  FrameHints hints;                                           ///< of the next frame alone
  cv::Mat image;                                              ///< of the next frame
  std::optional<Eigen::Quaterniond> image_turn;               ///< likewise
  std::function<std::shared_ptr<const RoadImage>(int)> road;  ///< of the drive's frames, or none
  std::function<std::shared_ptr<ImagePyramid>(int)> pyramid;  ///< likewise
  std::vector<FrameResult> results;
  std::vector<char> inlier_mask;  ///< of the last frame: the tracks that go on
  std::vector<int> point_ids;     ///< of the same matches

 private:
  static constexpr int kManyTracks = 1000000;

  Frame next_frame() {
    Frame frame;
    frame.number = static_cast<int>(results.size());
    frame.time_s = time_s_ += interval_s;
    frame.hints = std::exchange(hints, {});
    return frame;
  }

  Estimator& estimator_;
  const DriveTracks& drive_;
  std::map<int, int> num_rejected_;  ///< times, by point
  int last_ = -1;                    ///< frame of the drive
  int last_number_ = -1;             ///< its number for the estimator
  double time_s_ = 0.0;              ///< of the last frame
};

/// Greatest distance from the truth after a fit of scale, rotation and place, over the path's
/// length.
inline double fitted_error_share(std::span<const Rigid3> poses, std::span<const Rigid3> truth) {
  std::vector<Eigen::Vector3d> from;
  std::vector<Eigen::Vector3d> to;
  double length = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    from.push_back(poses[i].translation);
    to.push_back(truth[i].translation);
    length += i > 0 ? (to[i] - to[i - 1]).norm() : 0.0;
  }
  const Similarity3 fit = align_positions(from, to, Alignment::kSim3);
  double worst = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    worst = std::max(worst, (fit * from[i] - to[i]).norm());
  }
  return worst / length;
}

/// Greatest difference of rotations since the first of the poses, rad.
inline double rotation_error_rad(std::span<const Rigid3> poses, std::span<const Rigid3> truth) {
  double worst = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Quaterniond estimated = poses[0].rotation.conjugate() * poses[i].rotation;
    const Eigen::Quaterniond true_turn = truth[0].rotation.conjugate() * truth[i].rotation;
    worst = std::max(worst, estimated.angularDistance(true_turn));
  }
  return worst;
}

/// Length from a to b over its true length.
inline double length_ratio(std::span<const Rigid3> poses,
                           std::span<const Rigid3> truth,
                           int a,
                           int b) {
  const auto length = [&](std::span<const Rigid3> of) {
    return (of[static_cast<std::size_t>(b)].translation -
            of[static_cast<std::size_t>(a)].translation)
        .norm();
  };
  return length(poses) / length(truth);
}

/// The drive's point in the direction of a landmark, in the camera that saw it last.
inline Eigen::Vector3d true_place(const KeptLandmark& landmark, const DriveTracks& drive) {
  const Eigen::Vector3d direction = landmark.in_camera.cast<double>().normalized();
  const Rigid3 camera_from_world = drive.pose(landmark.frame).inverse();
  const auto cosine = [&](const Eigen::Vector3d& point) {
    return direction.dot((camera_from_world * point).normalized());
  };
  return camera_from_world * *std::ranges::max_element(drive.points, {}, cosine);
}

/// Distance from a landmark, placed by the poses, to its true place, over its depth. Both paths
/// begin at the origin.
inline double placing_error(const KeptLandmark& landmark,
                            std::span<const Rigid3> poses,
                            double unit_m,
                            const DriveTracks& drive) {
  const Eigen::Vector3d in_camera = true_place(landmark, drive);
  const Eigen::Vector3d place =
      poses[static_cast<std::size_t>(landmark.frame)] * landmark.in_camera.cast<double>();
  return (unit_m * place - drive.pose(landmark.frame) * in_camera).norm() / in_camera.z();
}

}  // namespace stemvo::testing
