// SPDX-License-Identifier: MIT
#include "calibration/segments.hpp"

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "calibration/patch_alignment.hpp"
#include "geometry/median.hpp"
#include "geometry/triangulation.hpp"

namespace stemvo::calibration {
namespace {

constexpr std::size_t kMaxSegments = 30;  ///< bounds the time of the solver on long drives
constexpr std::size_t kMaxKeyframes = 16;
constexpr std::size_t kMinKeyframes = 5;      ///< fewer: no segment
constexpr double kMinFlow_px = 4.0;           ///< median flow between keyframes
constexpr std::size_t kMinCommonTracks = 60;  ///< between keyframes, and landmarks of a segment
constexpr std::size_t kMinObservations = 4;   ///< of a landmark
constexpr std::size_t kMaxLandmarks = 400;    ///< of a segment, those seen most often
constexpr double kMaxStartError_px = 12.0;    ///< of a track under the odometry's poses

using Keyframe = SegmentBuilder::Keyframe;

const Rigid3& pose_of(const Segment& segment, const Observation& seen) {
  return segment.camera_from_first[static_cast<std::size_t>(seen.keyframe)];
}

std::vector<double> flow_px(const Keyframe& a, const Keyframe& b) {
  const PointPairs pairs = common_points(a.points, b.points);
  std::vector<double> lengths;
  for (std::size_t i = 0; i < pairs.cur_uv.size(); ++i) {
    lengths.push_back((pairs.cur_uv[i] - pairs.prev_uv[i]).norm());
  }
  return lengths;
}

/// Where two keyframes see it; at infinity where their rays are parallel or diverge.
Eigen::Vector4d start_point(const Segment& segment,
                            const std::vector<Observation>& observations,
                            const Camera& camera) {
  const Observation& a = observations.front();
  const Observation& b = observations.back();
  const Rigid3 first_from_a = pose_of(segment, a).inverse();
  const Eigen::Vector2d a_xy = camera.normalize(a.uv);
  const TriangulatedPoint point =
      triangulate(pose_of(segment, b) * first_from_a, a_xy, camera.normalize(b.uv));
  if (point.finite && point.in_prev.z() > 0.0) {
    return (first_from_a * point.in_prev).homogeneous().normalized();
  }
  const Eigen::Vector3d ray = first_from_a.rotation * a_xy.homogeneous();
  return Eigen::Vector4d(ray.x(), ray.y(), ray.z(), 0.0).normalized();
}

bool is_plausible(const Segment& segment, const Landmark& landmark, const Camera& camera) {
  return std::all_of(
      landmark.observations.begin(), landmark.observations.end(), [&](const Observation& seen) {
        const Eigen::Vector3d x = in_camera(pose_of(segment, seen), landmark.point);
        return x.z() > 1e-6 && (camera.project(x) - seen.uv).norm() <= kMaxStartError_px;
      });
}

/// Holds every observation against the one in the middle; those not found there are dropped.
void align(const Segment& segment, const std::vector<Keyframe>& keyframes, Landmark& landmark) {
  const Observation middle = landmark.observations[landmark.observations.size() / 2];
  const auto gray = [&](const Observation& seen) -> const cv::Mat& {
    return keyframes[static_cast<std::size_t>(seen.keyframe)].gray;
  };
  const auto depth = [&](const Observation& seen) {
    return in_camera(pose_of(segment, seen), landmark.point).z();
  };
  const std::optional<Patch> patch = Patch::cut(gray(middle), middle.uv);
  std::erase_if(landmark.observations, [&](Observation& seen) {
    if (!patch || seen.keyframe == middle.keyframe) {
      return !patch.has_value();
    }
    const Eigen::Matrix2d nearer = Eigen::Matrix2d::Identity() * (depth(middle) / depth(seen));
    const std::optional<PatchPose> found = patch->find(gray(seen), {seen.uv, nearer});
    seen.uv = found ? found->uv : seen.uv;
    return !found.has_value();
  });
}

}  // namespace

double turned_rad(const std::vector<Rigid3>& camera_from_first) {
  double sum = 0.0;
  for (std::size_t k = 1; k < camera_from_first.size(); ++k) {
    sum += (camera_from_first[k] * camera_from_first[k - 1].inverse()).angle_rad();
  }
  return sum;
}

void SegmentBuilder::add(const TrackedFrame& frame) {
  if (is_last_frame_open_) {
    add_begun_points(frame.matches, frame.is_inlier, open_.back().points);
  }
  Keyframe keyframe{frame.gray, frame.world_from_camera,
                    current_points(frame.matches, frame.is_inlier)};
  is_last_frame_open_ = true;
  if (open_.empty()) {
    open_.push_back(std::move(keyframe));
    return;
  }
  const std::vector<double> flow = flow_px(open_.back(), keyframe);
  if (!frame.is_measured || flow.size() < kMinCommonTracks) {
    close();
    open_ = {std::move(keyframe)};
  } else if (median(flow) >= kMinFlow_px) {
    open_.push_back(std::move(keyframe));
    if (open_.size() == kMaxKeyframes) {
      close();
      open_.erase(open_.begin(), open_.end() - 1);
    }
  } else {
    is_last_frame_open_ = false;
  }
}

void SegmentBuilder::close() {
  if (open_.size() < kMinKeyframes) {
    return;
  }
  Segment segment;
  std::map<int, std::vector<Observation>> tracks;
  for (std::size_t k = 0; k < open_.size(); ++k) {
    segment.camera_from_first.push_back(open_[k].world_from_camera.inverse() *
                                        open_.front().world_from_camera);
    for (const TrackPoint& point : open_[k].points) {
      tracks[point.track_id].push_back({static_cast<int>(k), point.uv});
    }
  }
  const auto is_long = [](const Landmark& landmark) {
    return landmark.observations.size() >= kMinObservations;
  };
  std::vector<Landmark> candidates;
  for (auto& [id, observations] : tracks) {
    Landmark landmark{start_point(segment, observations, camera_), std::move(observations)};
    if (is_long(landmark) && is_plausible(segment, landmark, camera_)) {
      candidates.push_back(std::move(landmark));
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.observations.size() > b.observations.size();
  });
  for (Landmark& landmark : candidates) {
    if (segment.landmarks.size() == kMaxLandmarks) {
      break;
    }
    align(segment, open_, landmark);
    if (is_long(landmark)) {
      segment.landmarks.push_back(std::move(landmark));
    }
  }
  if (segment.landmarks.size() >= kMinCommonTracks) {
    segments_.push_back(std::move(segment));
  }
}

std::vector<Segment> SegmentBuilder::complete() {
  close();
  std::vector<double> turns;
  for (const Segment& segment : segments_) {
    turns.push_back(turned_rad(segment.camera_from_first));
  }
  if (turns.size() > kMaxSegments) {
    const auto least = turns.begin() + kMaxSegments - 1;
    std::nth_element(turns.begin(), least, turns.end(), std::greater<>());
    std::erase_if(segments_, [&](const Segment& segment) {
      return turned_rad(segment.camera_from_first) < *least;
    });
  }
  return std::move(segments_);
}

}  // namespace stemvo::calibration
