// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "features/front_end.hpp"
#include "geometry/pixel_pairs.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Where the kept matches (one flag per match) start and end.
[[nodiscard]] Observations previous_points(const Matches& matches,
                                           const std::vector<char>& is_kept);
[[nodiscard]] Observations current_points(const Matches& matches, const std::vector<char>& is_kept);

/// Adds where kept matches start that `points`, of the frame they start at, lacks: new corners are
/// looked for once a frame's other points are known.
void add_begun_points(const Matches& matches,
                      const std::vector<char>& is_kept,
                      Observations& points);

/// The track's point, or nullptr.
[[nodiscard]] const Observation* find_point(const Observations& points, int track_id);

/// Tracks that two frames share.
[[nodiscard]] Matches common_points(const Observations& prev, const Observations& cur);

/// The values that the mask keeps.
template <typename List>
[[nodiscard]] auto select(const List& values, const std::vector<char>& mask) {
  std::vector<typename List::value_type> selected;
  selected.reserve(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (mask[i] != 0) {
      selected.push_back(values[i]);
    }
  }
  return selected;
}

// Medians: up to half of the matches may be wrong.

/// Length of the flow.
[[nodiscard]] double median_flow_px(const PixelPairs& pairs);

/// The tracks stay where they were, with less flow than `min_flow_px`, in more than half of the
/// image: by its cells, so that who stands still does not follow those who pass by. Then the median
/// flow of those that stay; nullopt also where the two share fewer than `min_tracks`.
[[nodiscard]] std::optional<double> stationary_flow_px(const Observations& before,
                                                       const Observations& now,
                                                       double min_flow_px,
                                                       int min_tracks);

/// Flow that the rotation, cur_from_prev, does not explain.
[[nodiscard]] double median_parallax_px(const Eigen::Quaterniond& rotation,
                                        const PixelPairs& pairs,
                                        const Camera& camera);

/// The same, root mean square: every match counts, so wrong ones must be out.
[[nodiscard]] double rms_parallax_px(const Eigen::Quaterniond& rotation,
                                     const PixelPairs& pairs,
                                     const Camera& camera);

/// Distance to the epipolar lines in both images (Sampson).
[[nodiscard]] double median_epipolar_px(const Rigid3& cur_from_prev,
                                        const PixelPairs& pairs,
                                        const Camera& camera);

/// Matches within `bound_px` of their epipolar lines; one flag per match.
[[nodiscard]] std::vector<char> epipolar_inliers(const Rigid3& cur_from_prev,
                                                 const PixelPairs& pairs,
                                                 const Camera& camera,
                                                 double bound_px);

}  // namespace stemvo
