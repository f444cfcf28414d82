// SPDX-License-Identifier: MIT
#include "odometry/moving_tracks.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>

#include "geometry/two_view_scores.hpp"
#include "odometry/cell_votes.hpp"
#include "odometry/robust_models.hpp"
#include "odometry/tracks.hpp"

namespace stemvo {
namespace {

/// Evidence of a track when it is taken for a thing's, and the most it can have.
constexpr int kFirstEvidence = 2;
constexpr int kMostEvidence = 5;

}  // namespace

void MovingTracks::begin(const Matches& matches, const std::vector<char>& moving_mask) {
  clear();
  for (const int track_id : select<int>(matches.track_ids, moving_mask)) {
    evidence_.emplace(track_id, kFirstEvidence);
  }
}

void MovingTracks::observe(const Matches& matches, const std::vector<char>& fits_world) {
  if (empty()) {
    return;
  }
  const std::vector<char> moving = flags(matches);
  const std::optional<Eigen::Matrix3d> motion =
      estimate_homography({select<Eigen::Vector2d>(matches.prev_uv, moving),
                           select<Eigen::Vector2d>(matches.cur_uv, moving)},
                          options_, seed_);
  std::map<int, int> before = std::exchange(evidence_, {});
  if (!motion.has_value()) {
    return;
  }
  const std::vector<char> fits_thing =
      score_homography(*motion, {matches.prev_uv, matches.cur_uv}, options_.inlier_threshold_px)
          .inlier_mask;
  const std::vector<double> shares = cell_shares(matches.cur_uv, moving);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    const int vote = (fits_thing[i] != 0 ? 1 : 0) - (fits_world[i] != 0 ? 1 : 0);
    const bool joins = fits_thing[i] != 0 && (fits_world[i] == 0 || shares[i] > 0.5);
    const int evidence = moving[i] != 0
                             ? std::min(before[matches.track_ids[i]] + vote, kMostEvidence)
                             : (joins ? kFirstEvidence : 0);
    if (evidence > 0) {
      evidence_.emplace(matches.track_ids[i], evidence);
    }
  }
}

std::vector<char> MovingTracks::flags(const Matches& matches) const {
  std::vector<char> mask(matches.track_ids.size());
  std::transform(matches.track_ids.begin(), matches.track_ids.end(), mask.begin(),
                 [&](int track_id) { return static_cast<char>(evidence_.contains(track_id)); });
  return mask;
}

void MovingTracks::leave_out(const Matches& matches, std::vector<char>& mask) const {
  for (std::size_t i = 0; i < mask.size(); ++i) {
    mask[i] = evidence_.contains(matches.track_ids[i]) ? char{0} : mask[i];
  }
}

}  // namespace stemvo
