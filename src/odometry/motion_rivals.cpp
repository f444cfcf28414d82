// SPDX-License-Identifier: MIT
#include "odometry/motion_rivals.hpp"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <utility>

#include "geometry/two_view_scores.hpp"
#include "odometry/cell_votes.hpp"
#include "odometry/tracks.hpp"

namespace stemvo {
namespace {

/// A party of fewer of the image's cells is noise, or too small to mislead.
constexpr double kMinParty = 0.15;
/// A motion explains matches where so many of their votes agree.
constexpr double kExplains = 0.75;
/// Depth counts so many times.
constexpr double kDepthWeight = 2.0;

std::vector<char> inverted(std::vector<char> mask) {
  for (char& flag : mask) {
    flag = flag != 0 ? 0 : 1;
  }
  return mask;
}

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

}  // namespace

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
      score_homography(*all.homography, pairs, options.sigma_px).inlier_mask;
  const std::vector<char> rest = inverted(plane);
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
  const bool has_depth = other.homography_ratio <= options.homography_ratio;
  if ((has_depth ? kDepthWeight : 1.0) * other_votes > plane_votes) {
    return MotionRivals{std::move(other), rest, plane, false};
  }
  MeasuredMotion world = measure_party(plane, pairs, camera, estimator);
  if (world.state == FrameState::kLost) {
    return std::nullopt;
  }
  // The other one's depth may yet show.
  const bool is_contested = kDepthWeight * other_votes > plane_votes;
  return MotionRivals{std::move(world), plane, std::move(other_mask), is_contested};
}

}  // namespace stemvo
