// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "calibration/patch_alignment.hpp"
#include "calibration/segment.hpp"
#include "stemvo/features/front_end.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo::calibration {

struct SegmentOptions {
  int num_keyframes = 16;          ///< at most
  int min_keyframes = 5;           ///< fewer: no segment
  double min_flow_px = 4.0;        ///< median flow between keyframes
  int min_common_tracks = 60;      ///< between keyframes, and landmarks of a segment
  int min_observations = 4;        ///< of a landmark
  int max_landmarks = 400;         ///< of a segment, those seen most often
  double max_start_error_px = 12;  ///< of a track under the odometry's poses
  PatchOptions patch;
};

/// A frame as the odometry left it.
struct TrackedFrame {
  cv::Mat gray;              ///< CV_8UC1
  Rigid3 world_from_camera;  ///< made with the given calibration
  bool is_measured = false;  ///< its motion from the frame before
  Matches matches;           ///< from the frame before, with track ids
  std::vector<char> is_inlier;
};

/// Cuts a drive into segments as its frames come. A segment begins at the keyframe that ended the
/// one before; a frame whose motion was not measured, or that shares too little, ends one. The
/// landmarks' observations are aligned anew with a patch from the middle of each track.
class SegmentBuilder {
 public:
  SegmentBuilder(const Camera& camera, const SegmentOptions& options)
      : camera_(camera), options_(options) {}

  void add(const TrackedFrame& frame);
  /// The end of the drive.
  [[nodiscard]] std::vector<Segment> finish();

 private:
  struct TrackPoint {
    int track_id = -1;
    Eigen::Vector2d uv = Eigen::Vector2d::Zero();
  };
  struct Keyframe {
    cv::Mat gray;
    Rigid3 world_from_camera;
    std::vector<TrackPoint> points;  ///< ordered by track id
  };
  static const TrackPoint* find_point(const Keyframe& keyframe, int track_id);
  static void sort_points(Keyframe& keyframe);
  static void add_begun_tracks(const TrackedFrame& next, Keyframe& keyframe);
  [[nodiscard]] std::vector<double> flow_px(const Keyframe& a, const Keyframe& b) const;
  void close();
  [[nodiscard]] Eigen::Vector4d start_point(const Segment& segment,
                                            const std::vector<Observation>& observations) const;
  [[nodiscard]] bool is_plausible(const Segment& segment, const Landmark& landmark) const;
  void align(const Segment& segment, Landmark& landmark) const;

  Camera camera_;
  SegmentOptions options_;
  std::vector<Keyframe> open_;
  bool is_last_frame_open_ = false;  ///< the last frame given is the last keyframe
  std::vector<Segment> segments_;
};

}  // namespace stemvo::calibration
