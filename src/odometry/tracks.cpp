// SPDX-License-Identifier: MIT
#include "odometry/tracks.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/median.hpp"
#include "geometry/two_view_models.hpp"
#include "odometry/moving_things.hpp"

namespace stemvo {
namespace {

Observations kept_points(const std::vector<int>& track_ids,
                         const std::vector<Eigen::Vector2d>& uv,
                         const std::vector<char>& is_kept) {
  Observations points;
  points.reserve(uv.size());
  for (std::size_t i = 0; i < uv.size(); ++i) {
    if (is_kept[i] != 0) {
      points.push_back({track_ids[i], uv[i]});
    }
  }
  std::ranges::sort(points, {}, &Observation::track_id);
  return points;
}

/// One of each match: length_of(prev_uv, cur_uv).
std::vector<double> lengths_of(const PixelPairs& pairs, const auto& length_of) {
  std::vector<double> lengths(pairs.size());
  std::ranges::transform(pairs.prev_uv, pairs.cur_uv, lengths.begin(), length_of);
  return lengths;
}

std::vector<double> flows_of(const PixelPairs& pairs) {
  return lengths_of(pairs, [](const auto& prev, const auto& cur) { return (cur - prev).norm(); });
}

/// The flow of each match that the rotation does not explain.
std::vector<double> parallaxes_px(const Eigen::Quaterniond& rotation,
                                  const PixelPairs& pairs,
                                  const Camera& camera) {
  return lengths_of(pairs, [&](const Eigen::Vector2d& prev, const Eigen::Vector2d& cur) {
    return (cur - camera.project(rotation * camera.normalize(prev).homogeneous())).norm();
  });
}

Eigen::Matrix3d fundamental_of(const Rigid3& cur_from_prev, const Camera& camera) {
  return fundamental_from_essential(essential_from_motion(cur_from_prev), camera);
}

}  // namespace

Observations previous_points(const Matches& matches, const std::vector<char>& is_kept) {
  return kept_points(matches.track_ids, matches.prev_uv, is_kept);
}

Observations current_points(const Matches& matches, const std::vector<char>& is_kept) {
  return kept_points(matches.track_ids, matches.cur_uv, is_kept);
}

void add_begun_points(const Matches& matches,
                      const std::vector<char>& is_kept,
                      Observations& points) {
  Observations begun = previous_points(matches, is_kept);
  std::erase_if(begun, [&](const Observation& point) {
    return find_point(points, point.track_id) != nullptr;
  });
  points.insert(points.end(), begun.begin(), begun.end());
  std::ranges::sort(points, {}, &Observation::track_id);
}

const Observation* find_point(const Observations& points, int track_id) {
  const auto found = std::ranges::lower_bound(points, track_id, {}, &Observation::track_id);
  return found != points.end() && found->track_id == track_id ? &*found : nullptr;
}

Matches common_points(const Observations& prev, const Observations& cur) {
  Matches pairs;
  for (const Observation& point : cur) {
    if (const Observation* other = find_point(prev, point.track_id)) {
      pairs.track_ids.push_back(point.track_id);
      pairs.prev_uv.push_back(other->uv);
      pairs.cur_uv.push_back(point.uv);
    }
  }
  return pairs;
}

double median_flow_px(const PixelPairs& pairs) { return median(flows_of(pairs)); }

std::optional<double> stationary_flow_px(const Observations& before,
                                         const Observations& now,
                                         double min_flow_px,
                                         int min_tracks) {
  const Matches pairs = common_points(before, now);
  const std::vector<double> flows_px = flows_of({pairs.prev_uv, pairs.cur_uv});
  std::vector<char> stays(flows_px.size());
  std::ranges::transform(flows_px, stays.begin(),
                         [&](double px) { return static_cast<char>(px < min_flow_px); });
  const std::vector<char> all(stays.size(), 1);
  const bool is_stationary =
      std::ssize(stays) >= min_tracks &&
      2.0 * cell_votes(pairs.prev_uv, stays) > cell_votes(pairs.prev_uv, all);
  return is_stationary ? std::optional(median(select(flows_px, stays))) : std::nullopt;
}

double median_parallax_px(const Eigen::Quaterniond& rotation,
                          const PixelPairs& pairs,
                          const Camera& camera) {
  return median(parallaxes_px(rotation, pairs, camera));
}

double rms_parallax_px(const Eigen::Quaterniond& rotation,
                       const PixelPairs& pairs,
                       const Camera& camera) {
  double sum = 0.0;
  for (const double length : parallaxes_px(rotation, pairs, camera)) {
    sum += length * length;
  }
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

double median_epipolar_px(const Rigid3& cur_from_prev,
                          const PixelPairs& pairs,
                          const Camera& camera) {
  const Eigen::Matrix3d fundamental = fundamental_of(cur_from_prev, camera);
  return median(lengths_of(pairs, [&](const Eigen::Vector2d& prev, const Eigen::Vector2d& cur) {
    const Eigen::Vector3d line_in_cur = fundamental * prev.homogeneous();
    const Eigen::Vector3d line_in_prev = fundamental.transpose() * cur.homogeneous();
    const double gradient = std::hypot(line_in_cur.head<2>().norm(), line_in_prev.head<2>().norm());
    return std::abs(cur.homogeneous().dot(line_in_cur)) / gradient;
  }));
}

std::vector<char> epipolar_inliers(const Rigid3& cur_from_prev,
                                   const PixelPairs& pairs,
                                   const Camera& camera,
                                   double bound_px) {
  // score_fundamental counts d^2 <= 3.841 sigma^2
  const double sigma_px = bound_px / std::sqrt(kFundamentalChi2);
  return score_fundamental(fundamental_of(cur_from_prev, camera), pairs, sigma_px).inlier_mask;
}

}  // namespace stemvo
