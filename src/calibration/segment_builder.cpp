// SPDX-License-Identifier: MIT
#include "calibration/segment_builder.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include "geometry/median.hpp"
#include "stemvo/geometry/triangulation.hpp"

namespace stemvo::calibration {
void SegmentBuilder::sort_points(Keyframe& keyframe) {
  std::sort(keyframe.points.begin(), keyframe.points.end(),
            [](const TrackPoint& a, const TrackPoint& b) { return a.track_id < b.track_id; });
}

const SegmentBuilder::TrackPoint* SegmentBuilder::find_point(const Keyframe& keyframe,
                                                             int track_id) {
  const auto found =
      std::lower_bound(keyframe.points.begin(), keyframe.points.end(), track_id,
                       [](const TrackPoint& point, int id) { return point.track_id < id; });
  return found != keyframe.points.end() && found->track_id == track_id ? &*found : nullptr;
}

/// New corners were found in the frame before: that is where their tracks begin.
void SegmentBuilder::add_begun_tracks(const TrackedFrame& next, Keyframe& keyframe) {
  std::vector<TrackPoint> begun;
  for (std::size_t i = 0; i < next.is_inlier.size(); ++i) {
    const int id = next.matches.track_ids[i];
    if (next.is_inlier[i] != 0 && find_point(keyframe, id) == nullptr) {
      begun.push_back({id, next.matches.prev_uv[i]});
    }
  }
  keyframe.points.insert(keyframe.points.end(), begun.begin(), begun.end());
  sort_points(keyframe);
}

std::vector<double> SegmentBuilder::flow_px(const Keyframe& a, const Keyframe& b) const {
  std::vector<double> lengths;
  for (const TrackPoint& point : a.points) {
    if (const TrackPoint* other = find_point(b, point.track_id)) {
      lengths.push_back((other->uv - point.uv).norm());
    }
  }
  return lengths;
}

void SegmentBuilder::add(const TrackedFrame& frame) {
  if (is_last_frame_open_) {
    add_begun_tracks(frame, open_.back());
  }
  Keyframe keyframe{frame.gray, frame.world_from_camera, {}};
  for (std::size_t i = 0; i < frame.is_inlier.size(); ++i) {
    if (frame.is_inlier[i] != 0) {
      keyframe.points.push_back({frame.matches.track_ids[i], frame.matches.cur_uv[i]});
    }
  }
  sort_points(keyframe);
  is_last_frame_open_ = true;
  if (open_.empty()) {
    open_.push_back(std::move(keyframe));
    return;
  }
  const std::vector<double> flow = flow_px(open_.back(), keyframe);
  if (!frame.is_measured || static_cast<int>(flow.size()) < options_.min_common_tracks) {
    close();
    open_ = {std::move(keyframe)};
  } else if (median(flow) >= options_.min_flow_px) {
    open_.push_back(std::move(keyframe));
    if (static_cast<int>(open_.size()) == options_.num_keyframes) {
      close();
      open_.erase(open_.begin(), open_.end() - 1);
    }
  } else {
    is_last_frame_open_ = false;
  }
}

std::vector<Segment> SegmentBuilder::finish() {
  close();
  open_.clear();
  return std::move(segments_);
}

/// Where two keyframes see it; at infinity where their rays are parallel or diverge.
Eigen::Vector4d SegmentBuilder::start_point(const Segment& segment,
                                            const std::vector<Observation>& observations) const {
  const Observation& a = observations.front();
  const Observation& b = observations.back();
  const Rigid3 first_from_a =
      segment.camera_from_first[static_cast<std::size_t>(a.keyframe)].inverse();
  const Rigid3& b_from_first = segment.camera_from_first[static_cast<std::size_t>(b.keyframe)];
  const Eigen::Vector2d a_xy = camera_.normalize(a.uv);
  const TriangulatedPoint point =
      triangulate(b_from_first * first_from_a, a_xy, camera_.normalize(b.uv));
  if (point.finite && point.in_prev.z() > 0.0) {
    return (first_from_a * point.in_prev).homogeneous().normalized();
  }
  const Eigen::Vector3d ray = first_from_a.rotation * a_xy.homogeneous();
  return Eigen::Vector4d(ray.x(), ray.y(), ray.z(), 0.0).normalized();
}

bool SegmentBuilder::is_plausible(const Segment& segment, const Landmark& landmark) const {
  return std::all_of(
      landmark.observations.begin(), landmark.observations.end(), [&](const Observation& seen) {
        const Eigen::Vector3d x = in_keyframe(segment, seen.keyframe, landmark.point);
        return x.z() > 1e-6 && (camera_.project(x) - seen.uv).norm() <= options_.max_start_error_px;
      });
}

/// Holds every observation against the one in the middle; those not found there are dropped.
void SegmentBuilder::align(const Segment& segment, Landmark& landmark) const {
  const Observation middle = landmark.observations[landmark.observations.size() / 2];
  const auto gray = [&](const Observation& seen) -> const cv::Mat& {
    return open_[static_cast<std::size_t>(seen.keyframe)].gray;
  };
  const auto depth = [&](const Observation& seen) {
    return in_keyframe(segment, seen.keyframe, landmark.point).z();
  };
  const std::optional<Patch> patch = Patch::cut(gray(middle), middle.uv, options_.patch);
  std::erase_if(landmark.observations, [&](Observation& seen) {
    if (!patch || seen.keyframe == middle.keyframe) {
      return !patch.has_value();
    }
    const Eigen::Matrix2d nearer = Eigen::Matrix2d::Identity() * (depth(middle) / depth(seen));
    const std::optional<PatchPlace> place = patch->find(gray(seen), {seen.uv, nearer});
    seen.uv = place ? place->uv : seen.uv;
    return !place.has_value();
  });
}

void SegmentBuilder::close() {
  if (static_cast<int>(open_.size()) < options_.min_keyframes) {
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
  const auto is_short = [&](const Landmark& landmark) {
    return static_cast<int>(landmark.observations.size()) < options_.min_observations;
  };
  std::vector<Landmark> candidates;
  for (auto& [id, observations] : tracks) {
    Landmark landmark{start_point(segment, observations), std::move(observations)};
    if (!is_short(landmark) && is_plausible(segment, landmark)) {
      candidates.push_back(std::move(landmark));
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.observations.size() > b.observations.size();
  });
  for (Landmark& landmark : candidates) {
    if (static_cast<int>(segment.landmarks.size()) == options_.max_landmarks) {
      break;
    }
    align(segment, landmark);
    if (!is_short(landmark)) {
      segment.landmarks.push_back(std::move(landmark));
    }
  }
  if (static_cast<int>(segment.landmarks.size()) >= options_.min_common_tracks) {
    segments_.push_back(std::move(segment));
  }
}

}  // namespace stemvo::calibration
