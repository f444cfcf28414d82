// SPDX-License-Identifier: MIT
#include "odometry/initializer.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include <Eigen/Eigenvalues>

#include "geometry/pose_refinement.hpp"
#include "geometry/two_view_models.hpp"
#include "odometry/moving_things.hpp"

namespace stemvo {
namespace {

constexpr double kMinLiving = 0.3;
/// A window that opens with fewer would soon be lost.
constexpr int kMinLandmarks = 25;

/// The step that opens a map differs so much from the later ones' unit (rms over openings on the
/// clips 0.03, the worst 0.14), and in direction, where things move among the points (rendered
/// traffic: up to 0.04); a turn makes up for that share of the parallax.
constexpr double kOpening = 0.05;

/// Hypotheses with fewer than this share of the most good points are out.
constexpr double kMinGoodShare = 0.85;
/// The second best hypothesis costs so many times the best: the parallax decides.
constexpr double kMinMargin = 1.2;
/// As ORB-SLAM2's, but the share is of all matches here, outliers included, half the parallax will
/// do, and other hypotheses are told apart by their cost.
constexpr AcceptanceOptions kAcceptance{.min_good = 30,
                                        .min_good_share = 0.3,
                                        .min_parallax_deg = 0.5,
                                        .max_runner_up_homography = 1.1,
                                        .max_runner_up_essential = 1.1};
/// The standard deviation of its direction is less, radians: one that is off makes a map of wrong
/// depths, which bears its frames for long. Openings on the hand-held clip have 0.02 to 0.08.
constexpr double kMaxDirectionSigma_rad = 0.05;
/// Refined hypotheses nearer than this are one.
constexpr double kSameAngle_rad = 0.1;

/// A motion that one of the models allows.
struct Hypothesis {
  TwoViewModel model = TwoViewModel::kNone;
  Rigid3 cur_from_prev;
  double cost = 0.0;  ///< once refined
  int num_good = 0;
};

bool is_same(const Rigid3& a, const Rigid3& b) {
  return a.rotation.angularDistance(b.rotation) < kSameAngle_rad &&
         a.translation.dot(b.translation) > std::cos(kSameAngle_rad);
}

/// The hypotheses with nearly the most good points.
std::vector<Hypothesis> plausible_hypotheses(const MeasuredMotion& motion,
                                             const PixelPairs& pairs,
                                             const Camera& camera) {
  std::vector<Hypothesis> hypotheses;
  int most_good = 0;
  const auto test = [&](TwoViewModel model, std::span<const Rigid3> motions) {
    for (const Rigid3& cur_from_prev : motions) {
      const int num_good = test_points(cur_from_prev, pairs, camera).num_good;
      hypotheses.push_back({model, cur_from_prev, 0.0, num_good});
      most_good = std::max(most_good, num_good);
    }
  };
  if (motion.homography.has_value()) {
    test(TwoViewModel::kHomography, decompose_homography(*motion.homography, camera));
  }
  if (motion.essential.has_value()) {
    test(TwoViewModel::kEssential, decompose_essential(*motion.essential));
  }
  std::erase_if(hypotheses, [&](const Hypothesis& hypothesis) {
    return hypothesis.num_good < kMinGoodShare * most_good;
  });
  return hypotheses;
}

/// The cheapest first.
void refine(std::vector<Hypothesis>& hypotheses,
            const PixelPairs& pairs,
            const Camera& camera,
            double loss_px) {
  for (Hypothesis& hypothesis : hypotheses) {
    const RefinedMotion refined =
        refine_relative_pose(hypothesis.cur_from_prev, pairs, camera, {.loss_scale_px = loss_px});
    hypothesis.cur_from_prev = refined.cur_from_prev;
    hypothesis.cost = refined.cost;
  }
  std::ranges::sort(hypotheses, {}, &Hypothesis::cost);
}

/// Flags of tracks as flags of matches; `otherwise`: that of a match which is no such track.
std::vector<char> flags_of(const Matches& matches,
                           const std::vector<int>& track_ids,
                           const std::vector<char>& flags,
                           char otherwise) {
  std::vector<char> mask(matches.track_ids.size(), otherwise);
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const auto track = std::lower_bound(track_ids.begin(), track_ids.end(), matches.track_ids[i]);
    if (track != track_ids.end() && *track == matches.track_ids[i]) {
      mask[i] = flags[static_cast<std::size_t>(track - track_ids.begin())];
    }
  }
  return mask;
}

}  // namespace

bool Initializer::lost_reference(const Observations& now) const {
  const auto living = static_cast<double>(common_points(reference_.points, now).cur_uv.size());
  return living < kMinLiving * static_cast<double>(reference_.points.size());
}

MeasuredMotion Initializer::measure(const Matches& matches,
                                    const Observations& now,
                                    const Camera& camera) {
  const std::vector<char> all(matches.cur_uv.size(), 1);
  if (reference_.points.empty()) {
    reference_.points = previous_points(matches, all);
  }
  const Matches pairs = common_points(reference_.points, now);
  const PixelPairs pixels(pairs.prev_uv, pairs.cur_uv);
  MeasuredMotion motion = measure_world(pixels, camera);
  motion.inlier_mask = flags_of(matches, pairs.track_ids, motion.inlier_mask, 1);
  motion.moving_mask = flags_of(matches, pairs.track_ids, motion.moving_mask, 0);
  return motion;
}

MeasuredMotion Initializer::measure_world(const PixelPairs& pairs, const Camera& camera) const {
  MeasuredMotion motion = two_view_.measure(pairs, camera, /*is_initializing=*/true);
  auto rivals = find_rivals(motion, pairs, camera, options_, two_view_);
  if (!rivals.has_value()) {
    if (motion.state == FrameState::kTracking) {
      choose_motion(pairs, camera, motion);
    }
    motion.moving_mask.assign(pairs.size(), 0);
    return motion;
  }
  MeasuredMotion& world = rivals->world;
  const auto prev = select(pairs.prev_uv, rivals->world_party);
  const auto cur = select(pairs.cur_uv, rivals->world_party);
  if (world.state == FrameState::kTracking) {
    choose_motion({prev, cur}, camera, world);
    world.is_decisive = world.is_decisive && !rivals->is_contested;
  }
  world.inlier_mask = scatter(world.inlier_mask, rivals->world_party);
  return std::move(world);
}

void Initializer::choose_motion(const PixelPairs& pairs,
                                const Camera& camera,
                                MeasuredMotion& motion) const {
  motion.is_decisive = false;
  std::vector<Hypothesis> hypotheses = plausible_hypotheses(motion, pairs, camera);
  refine(hypotheses, pairs, camera, options_.refine_loss_px);
  if (hypotheses.empty()) {
    return;
  }
  // Wrong matches cost every hypothesis the same: they are compared on what the best one explains.
  const std::vector<char> explained =
      test_points(hypotheses.front().cur_from_prev, pairs, camera).good_mask;
  refine(hypotheses, {select(pairs.prev_uv, explained), select(pairs.cur_uv, explained)}, camera,
         options_.refine_loss_px);
  const Hypothesis& best = hypotheses.front();
  const auto rival = std::find_if(
      hypotheses.begin(), hypotheses.end(),
      [&](const Hypothesis& other) { return !is_same(other.cur_from_prev, best.cur_from_prev); });
  // With few tracks, require a quarter of them.
  const int num_pairs = static_cast<int>(pairs.size());
  const TwoViewMotion chosen{best.model, best.cur_from_prev,
                             test_points(best.cur_from_prev, pairs, camera,
                                         {.parallax_rank = std::clamp(num_pairs / 4, 1, 51)})};
  motion.model = best.model;
  motion.cur_from_prev = best.cur_from_prev;
  motion.inlier_mask = chosen.test.good_mask;
  two_view_.refine(pairs, camera, motion);
  // The way has length 1: its covariance is of its direction.
  const double direction_variance =
      motion.covariance.topLeftCorner<3, 3>().selfadjointView<Eigen::Lower>().operatorNorm();
  motion.is_decisive = is_decisive(chosen, num_pairs, kAcceptance) &&
                       (rival == hypotheses.end() || rival->cost > kMinMargin * best.cost) &&
                       direction_variance < kMaxDirectionSigma_rad * kMaxDirectionSigma_rad;
}

Matrix6d Initializer::opening_error(const MeasuredMotion& motion,
                                    const Observations& now,
                                    const Camera& camera) const {
  const Matches pairs = common_points(reference_.points, now);
  const double parallax_px =
      rms_parallax_px(motion.cur_from_prev.rotation, {pairs.prev_uv, pairs.cur_uv}, camera);
  Vector6d sigma;
  sigma << Eigen::Vector3d::Ones(), Eigen::Vector3d::Constant(parallax_px / camera.mean_focal_px());
  return (kOpening * sigma).cwiseAbs2().asDiagonal();
}

std::optional<Window> Initializer::open_window(const View& now,
                                               const Camera& camera,
                                               const WindowOptions& window_options) const {
  Window window;
  for (const View* view : {&reference_, &now}) {
    window.keyframes.push_back({view->frame, view->world_from_camera, view->points});
  }
  triangulate_landmarks(window, camera, window_options);
  if (static_cast<int>(window.landmarks.size()) < kMinLandmarks) {
    return std::nullopt;
  }
  return window;
}

}  // namespace stemvo
