// SPDX-License-Identifier: MIT
#include "odometry/moving_tracks.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>

#include "geometry/two_view_scores.hpp"
#include "odometry/robust_models.hpp"
#include "odometry/tracks.hpp"

namespace stemvo {
namespace {

/// Cells are squares, so many in a row.
constexpr int kCellsInRow = 12;
/// Evidence of a track when it is taken for a thing's, and the most it can have.
constexpr int kFirstEvidence = 2;
constexpr int kMostEvidence = 5;

struct Cell {
  int num_points = 0;
  int num_agreeing = 0;
};
using Cells = std::map<std::pair<int, int>, Cell>;

std::pair<int, int> cell_of(const Eigen::Vector2d& uv, const Camera& camera) {
  const double cell_px = static_cast<double>(camera.width_px) / kCellsInRow;
  return {static_cast<int>(uv.x() / cell_px), static_cast<int>(uv.y() / cell_px)};
}

Cells count_cells(PixelPairs::Points uv, const std::vector<char>& agrees, const Camera& camera) {
  Cells cells;
  for (std::size_t i = 0; i < uv.size(); ++i) {
    Cell& cell = cells[cell_of(uv[i], camera)];
    ++cell.num_points;
    cell.num_agreeing += agrees[i] != 0 ? 1 : 0;
  }
  return cells;
}

}  // namespace

double cell_votes(PixelPairs::Points uv, const std::vector<char>& agrees, const Camera& camera) {
  double votes = 0.0;
  for (const auto& [place, cell] : count_cells(uv, agrees, camera)) {
    votes += static_cast<double>(cell.num_agreeing) / cell.num_points;
  }
  return votes;
}

std::vector<double> cell_shares(PixelPairs::Points uv,
                                const std::vector<char>& agrees,
                                const Camera& camera) {
  const Cells cells = count_cells(uv, agrees, camera);
  std::vector<double> shares;
  shares.reserve(uv.size());
  for (const Eigen::Vector2d& point : uv) {
    const Cell& cell = cells.at(cell_of(point, camera));
    shares.push_back(static_cast<double>(cell.num_agreeing) / cell.num_points);
  }
  return shares;
}

void MovingTracks::begin(const Matches& matches, const std::vector<char>& moving_mask) {
  clear();
  for (const int track_id : select<int>(matches.track_ids, moving_mask)) {
    evidence_.emplace(track_id, kFirstEvidence);
  }
}

void MovingTracks::observe(const Matches& matches,
                           const std::vector<char>& fits_world,
                           const Camera& camera) {
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
  const std::vector<double> shares = cell_shares(matches.cur_uv, moving, camera);
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
