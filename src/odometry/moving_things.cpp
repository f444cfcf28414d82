// SPDX-License-Identifier: MIT
#include "odometry/moving_things.hpp"

#include <algorithm>
#include <functional>
#include <limits>
#include <utility>

#include "geometry/two_view_models.hpp"
#include "odometry/robust_models.hpp"
#include "odometry/tracks.hpp"

namespace stemvo {
namespace {

constexpr double kCellsInRow = 12.0;

/// The square cells of an image that show points.
struct Cells {
  Cells(std::span<const Eigen::Vector2d> uv, const std::vector<char>& agrees) {
    double least = std::numeric_limits<double>::infinity();
    double most = -least;
    for (const Eigen::Vector2d& point : uv) {
      least = std::min(least, point.x());
      most = std::max(most, point.x());
    }
    const double cell_px = std::max(1.0, (most - least) / kCellsInRow);
    for (std::size_t i = 0; i < uv.size(); ++i) {
      Cell& cell =
          all[{static_cast<int>(uv[i].x() / cell_px), static_cast<int>(uv[i].y() / cell_px)}];
      ++cell.num_points;
      cell.num_agreeing += agrees[i] != 0 ? 1 : 0;
      of_point.push_back(&cell);
    }
  }

  struct Cell {
    int num_points = 0;
    int num_agreeing = 0;
    [[nodiscard]] double share() const { return static_cast<double>(num_agreeing) / num_points; }
  };
  std::map<std::pair<int, int>, Cell> all;
  std::vector<const Cell*> of_point;
};

/// A party of fewer of the image's cells is noise, or too small to mislead.
constexpr double kMinParty = 0.15;
/// Bound of the plane, of that which counts elsewhere: far points of the world that move nearly as
/// the thing does are the ones that tell the world's turn.
constexpr double kOnPlane = 0.5;
/// A motion explains matches where so many of their votes agree.
constexpr double kExplains = 0.55;
/// One motion that explains so many times what two do is enough: in a scene without things that
/// move two fit a little better, too.
constexpr double kOneIsEnough = 0.85;
/// Depth counts so many times.
constexpr double kDepthWeight = 2.0;

MeasuredMotion measure_party(const std::vector<char>& party,
                             const PixelPairs& pairs,
                             const Camera& camera,
                             const TwoViewEstimator& estimator) {
  const auto prev = select(pairs.prev_uv, party);
  const auto cur = select(pairs.cur_uv, party);
  return estimator.measure({prev, cur}, camera, /*is_initializing=*/true);
}

/// Matches, the party's own or not, that a motion explains.
std::vector<char> explained(const MeasuredMotion& motion,
                            const PixelPairs& pairs,
                            const Camera& camera,
                            double bound_px) {
  if (motion.state == FrameState::kRotating || motion.state == FrameState::kStationary) {
    return score_homography(
               camera.matrix() * motion.cur_from_prev.rotation_matrix() * camera.matrix().inverse(),
               pairs, bound_px / 2.0)
        .inlier_mask;
  }
  return epipolar_inliers(motion.cur_from_prev, pairs, camera, bound_px);
}

/// Frames in which a thing that was not known moves apart from the world.
constexpr int kMinApart = 2;
/// Evidence of a track when it is taken for a thing's, and the most it can have.
constexpr int kFirstEvidence = 2;
constexpr int kMostEvidence = 5;

}  // namespace

double cell_votes(std::span<const Eigen::Vector2d> uv, const std::vector<char>& agrees) {
  double votes = 0.0;
  for (const auto& [place, cell] : Cells(uv, agrees).all) {
    votes += cell.share();
  }
  return votes;
}

std::vector<char> without(const std::vector<char>& some, const std::vector<char>& mask) {
  std::vector<char> rest(mask.size());
  std::ranges::transform(mask, some, rest.begin(), [](char is_kept, char is_one) {
    return static_cast<char>(is_kept != 0 && is_one == 0);
  });
  return rest;
}

std::vector<char> scatter(const std::vector<char>& flags, const std::vector<char>& party) {
  std::vector<char> scattered(party.size(), 0);
  auto flag = flags.begin();
  for (std::size_t i = 0; i < party.size(); ++i) {
    scattered[i] = party[i] != 0 ? *flag++ : char{0};
  }
  return scattered;
}

std::optional<MotionRivals> find_rivals(const MeasuredMotion& all,
                                        const PixelPairs& pairs,
                                        const Camera& camera,
                                        const TwoViewOptions& options,
                                        const TwoViewEstimator& estimator) {
  if (!all.homography.has_value()) {
    return std::nullopt;
  }
  const std::vector<char> plane =
      score_homography(*all.homography, pairs, kOnPlane * options.sigma_px).inlier_mask;
  const std::vector<char> rest = without(plane, std::vector<char>(plane.size(), 1));
  const auto votes = [&](const std::vector<char>& agrees) {
    return cell_votes(pairs.cur_uv, agrees);
  };
  const double plane_votes = votes(plane);
  const double rest_votes = votes(rest);
  const double least = kMinParty * (plane_votes + rest_votes);
  if (std::min(plane_votes, rest_votes) < least) {
    return std::nullopt;
  }
  MeasuredMotion other = measure_party(rest, pairs, camera, estimator);
  std::vector<char> other_mask = scatter(other.inlier_mask, rest);
  const double other_votes = votes(other_mask);
  if (other.state == FrameState::kLost || other_votes < least) {
    return std::nullopt;
  }
  std::vector<char> both = explained(other, pairs, camera, 2.0 * options.inlier_threshold_px);
  std::transform(both.begin(), both.end(), plane.begin(), both.begin(), std::logical_and<char>());
  if (votes(both) >= kExplains * plane_votes) {
    return std::nullopt;
  }
  const double one_votes = votes(explained(all, pairs, camera, options.inlier_threshold_px));
  if (one_votes >= kOneIsEnough * (plane_votes + other_votes)) {
    return std::nullopt;
  }
  const bool has_depth = other.homography_ratio <= options.homography_ratio;
  if ((has_depth ? kDepthWeight : 1.0) * other_votes > plane_votes) {
    other.moving_mask = plane;
    return MotionRivals{std::move(other), rest, false};
  }
  MeasuredMotion world = measure_party(plane, pairs, camera, estimator);
  if (world.state == FrameState::kLost) {
    return std::nullopt;
  }
  // The other one's depth may yet show.
  const bool is_contested = kDepthWeight * other_votes > plane_votes;
  world.moving_mask = std::move(other_mask);
  return MotionRivals{std::move(world), plane, is_contested};
}

void MovingTracks::add(const Matches& matches, const std::vector<char>& moving_mask) {
  for (const int track_id : select(matches.track_ids, moving_mask)) {
    evidence_.emplace(track_id, kFirstEvidence);
  }
}

std::vector<char> MovingTracks::members(const Matches& matches) const {
  std::vector<char> mask(matches.track_ids.size());
  std::ranges::transform(matches.track_ids, mask.begin(), [&](int track_id) {
    return static_cast<char>(evidence_.contains(track_id));
  });
  return mask;
}

std::vector<char> MovingTracks::flags(const Matches& matches,
                                      const std::map<int, Eigen::Vector3d>& landmarks) const {
  const std::vector<char> moving = members(matches);
  const std::vector<Eigen::Vector2d> things = select(matches.cur_uv, moving);
  std::vector<char> mask = moving;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const auto is_beside = [&](const Eigen::Vector2d& of_thing) {
      return (of_thing - matches.cur_uv[i]).norm() < border_px_;
    };
    if (mask[i] == 0 && !landmarks.contains(matches.track_ids[i])) {
      mask[i] = static_cast<char>(std::ranges::any_of(things, is_beside));
    }
  }
  return mask;
}

std::optional<std::vector<char>> MovingTracks::move_as_one(const Matches& matches,
                                                           const std::vector<char>& some) const {
  const std::optional<Eigen::Matrix3d> motion = estimate_homography(
      {select(matches.prev_uv, some), select(matches.cur_uv, some)}, options_, seed_);
  if (!motion.has_value()) {
    return std::nullopt;
  }
  return score_homography(*motion, {matches.prev_uv, matches.cur_uv}, options_.inlier_threshold_px)
      .inlier_mask;
}

void MovingTracks::find(const Matches& matches, const std::vector<char>& fits_pose) {
  const int num_apart = std::exchange(num_apart_, 0);
  const std::vector<char> all(matches.cur_uv.size(), 1);
  const std::vector<char> rest = without(members(matches), without(fits_pose, all));
  const auto may_mislead = [&](const std::vector<char>& some) {
    return cell_votes(matches.cur_uv, some) >= kMinParty * cell_votes(matches.cur_uv, all);
  };
  if (!may_mislead(rest)) {
    return;
  }
  if (const auto as_one = move_as_one(matches, rest)) {
    const std::vector<char> thing = without(without(*as_one, all), rest);
    num_apart_ = may_mislead(thing) ? num_apart + 1 : 0;
    if (num_apart_ >= kMinApart) {
      add(matches, thing);
    }
  }
}

void MovingTracks::observe(const Matches& matches, const std::vector<char>& fits_world) {
  if (empty()) {
    return;
  }
  const std::vector<char> moving = members(matches);
  const std::optional<std::vector<char>> fits_thing = move_as_one(matches, moving);
  std::map<int, int> before = std::exchange(evidence_, {});
  if (!fits_thing.has_value()) {
    return;
  }
  const std::vector<char> world = without(moving, fits_world);
  const auto num_world = std::ranges::count(world, char{1});
  const bool is_apart = 2 * std::ranges::count(without(*fits_thing, world), char{1}) >= num_world;
  const Cells cells(matches.cur_uv, moving);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    const bool fits = (*fits_thing)[i] != 0;
    const int vote = (fits ? 1 : 0) - (fits_world[i] != 0 ? 1 : 0);
    const bool joins = is_apart && fits && (fits_world[i] == 0 || cells.of_point[i]->share() > 0.5);
    const int evidence = moving[i] != 0
                             ? std::min(before[matches.track_ids[i]] + vote, kMostEvidence)
                             : (joins ? kFirstEvidence : 0);
    if (evidence > 0) {
      evidence_.emplace(matches.track_ids[i], evidence);
    }
  }
}

}  // namespace stemvo
