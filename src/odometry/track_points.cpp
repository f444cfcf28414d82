// SPDX-License-Identifier: MIT
#include "odometry/track_points.hpp"

#include <algorithm>

namespace stemvo {
namespace {

bool is_before(const TrackPoint& a, const TrackPoint& b) { return a.track_id < b.track_id; }

void sort_by_id(TrackPoints& points) {
  if (!std::is_sorted(points.begin(), points.end(), is_before)) {
    std::sort(points.begin(), points.end(), is_before);
  }
}

}  // namespace

TrackPoints current_points(const Matches& matches, const std::vector<char>& is_kept) {
  TrackPoints points;
  points.reserve(matches.cur_uv.size());
  for (std::size_t i = 0; i < matches.cur_uv.size(); ++i) {
    if (is_kept[i] != 0) {
      points.push_back({matches.track_ids[i], matches.cur_uv[i]});
    }
  }
  sort_by_id(points);
  return points;
}

void add_begun_points(const Matches& matches,
                      const std::vector<char>& is_kept,
                      TrackPoints& points) {
  TrackPoints begun;
  for (std::size_t i = 0; i < matches.prev_uv.size(); ++i) {
    if (is_kept[i] != 0 && find_point(points, matches.track_ids[i]) == nullptr) {
      begun.push_back({matches.track_ids[i], matches.prev_uv[i]});
    }
  }
  points.insert(points.end(), begun.begin(), begun.end());
  sort_by_id(points);
}

const TrackPoint* find_point(const TrackPoints& points, int track_id) {
  const auto found =
      std::lower_bound(points.begin(), points.end(), TrackPoint{track_id, {}}, is_before);
  return found != points.end() && found->track_id == track_id ? &*found : nullptr;
}

PointPairs common_points(const TrackPoints& prev, const TrackPoints& cur) {
  PointPairs pairs;
  auto other = prev.begin();
  for (const TrackPoint& point : cur) {
    while (other != prev.end() && is_before(*other, point)) {
      ++other;
    }
    if (other != prev.end() && other->track_id == point.track_id) {
      pairs.track_ids.push_back(point.track_id);
      pairs.prev_uv.push_back(other->uv);
      pairs.cur_uv.push_back(point.uv);
    }
  }
  return pairs;
}

}  // namespace stemvo
