// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <Eigen/Core>

#include "stemvo/features/front_end.hpp"

namespace stemvo {

/// A track seen in a frame.
struct TrackPoint {
  int track_id = -1;
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();  ///< input pixels
};
/// Of one frame, ordered by track id.
using TrackPoints = std::vector<TrackPoint>;

/// Where the matches end, of those kept (one flag per match).
[[nodiscard]] TrackPoints current_points(const Matches& matches, const std::vector<char>& is_kept);

/// Adds where kept matches start that `points`, of the frame they start at, lacks: new corners are
/// looked for once a frame's other points are known.
void add_begun_points(const Matches& matches,
                      const std::vector<char>& is_kept,
                      TrackPoints& points);

/// The track's point, or nullptr.
[[nodiscard]] const TrackPoint* find_point(const TrackPoints& points, int track_id);

/// Tracks that two frames share.
struct PointPairs {
  std::vector<int> track_ids;
  std::vector<Eigen::Vector2d> prev_uv;
  std::vector<Eigen::Vector2d> cur_uv;

  [[nodiscard]] int size() const { return static_cast<int>(track_ids.size()); }
};
[[nodiscard]] PointPairs common_points(const TrackPoints& prev, const TrackPoints& cur);

}  // namespace stemvo
