// SPDX-License-Identifier: MIT
#include "odometry/initializer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stemvo/geometry/decomposition.hpp"
#include "stemvo/geometry/relative_pose_refinement.hpp"
#include "stemvo/geometry/two_view_motion.hpp"

namespace stemvo {
namespace {

/// So many frames can be localized afterwards; earlier ones stay where the reference is.
constexpr std::size_t kMaxWaiting = 300;
constexpr double kMinLiving = 0.3;
/// A window that opens with fewer would soon be lost.
constexpr int kMinLandmarks = 25;

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
/// Refined hypotheses nearer than this are one.
constexpr double kSameAngle_rad = 0.1;

std::vector<InitialHypothesis> list_hypotheses(const MeasuredMotion& motion, const Camera& camera) {
  std::vector<InitialHypothesis> hypotheses;
  if (motion.homography.has_value()) {
    for (const PlanarMotion& planar : decompose_homography(*motion.homography, camera)) {
      hypotheses.push_back({TwoViewModel::kHomography, planar.cur_from_prev});
    }
  }
  if (motion.essential.has_value()) {
    for (const Rigid3& cur_from_prev : decompose_essential(*motion.essential)) {
      hypotheses.push_back({TwoViewModel::kEssential, cur_from_prev});
    }
  }
  return hypotheses;
}

bool is_same(const Rigid3& a, const Rigid3& b) {
  return a.rotation.angularDistance(b.rotation) < kSameAngle_rad &&
         a.translation.dot(b.translation) > std::cos(kSameAngle_rad);
}

/// Those with nearly the most good points.
std::vector<InitialHypothesis> plausible_hypotheses(const MeasuredMotion& motion,
                                                    const PointPairs& pairs,
                                                    const Camera& camera) {
  std::vector<InitialHypothesis> hypotheses = list_hypotheses(motion, camera);
  int most_good = 0;
  for (InitialHypothesis& hypothesis : hypotheses) {
    hypothesis.num_good =
        test_points(hypothesis.cur_from_prev, pairs.prev_uv, pairs.cur_uv, camera).num_good;
    most_good = std::max(most_good, hypothesis.num_good);
  }
  std::erase_if(hypotheses, [&](const InitialHypothesis& hypothesis) {
    return hypothesis.num_good < kMinGoodShare * most_good;
  });
  return hypotheses;
}

PointPairs select(const PointPairs& pairs, const std::vector<char>& mask) {
  PointPairs selected;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] != 0) {
      selected.track_ids.push_back(pairs.track_ids[i]);
      selected.prev_uv.push_back(pairs.prev_uv[i]);
      selected.cur_uv.push_back(pairs.cur_uv[i]);
    }
  }
  return selected;
}

}  // namespace

Initializer::Initializer(const Config& config, const Camera& camera)
    : camera_(camera),
      loss_px_(config.two_view.refine_loss_px),
      two_view_(config, camera),
      seed_(config.seed) {}

void Initializer::start(View reference) {
  reference_ = std::move(reference);
  waiting_.clear();
}

bool Initializer::is_worn_out(const TrackPoints& now) const {
  const auto living = static_cast<double>(common_points(reference_.points, now).size());
  return living < kMinLiving * static_cast<double>(reference_.points.size());
}

MeasuredMotion Initializer::measure(const Matches& matches, const TrackPoints& now) {
  const std::vector<char> all(matches.cur_uv.size(), 1);
  if (matches.prev_frame == reference_.frame) {
    add_begun_points(matches, all, reference_.points);
  }
  const PointPairs pairs = common_points(reference_.points, now);
  MeasuredMotion motion =
      two_view_.measure(pairs.prev_uv, pairs.cur_uv, /*is_initializing=*/true, seed_);
  if (motion.state == FrameState::kTracking) {
    choose_motion(pairs, motion);
  }
  std::vector<char> mask = all;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const auto pair =
        std::lower_bound(pairs.track_ids.begin(), pairs.track_ids.end(), matches.track_ids[i]);
    if (pair != pairs.track_ids.end() && *pair == matches.track_ids[i]) {
      mask[i] = motion.inlier_mask[static_cast<std::size_t>(pair - pairs.track_ids.begin())];
    }
  }
  motion.inlier_mask = std::move(mask);
  return motion;
}

std::vector<InitialHypothesis> Initializer::refined(
    const std::vector<InitialHypothesis>& hypotheses, const PointPairs& pairs) const {
  std::vector<InitialHypothesis> refined;
  for (const InitialHypothesis& hypothesis : hypotheses) {
    const RelativePoseRefinement refinement =
        refine_relative_pose(hypothesis.cur_from_prev, pairs.prev_uv, pairs.cur_uv, camera_,
                             {.loss_scale_px = loss_px_});
    refined.push_back({hypothesis.model, refinement.cur_from_prev, refinement.final_cost});
  }
  std::sort(refined.begin(), refined.end(),
            [](const InitialHypothesis& a, const InitialHypothesis& b) { return a.cost < b.cost; });
  return refined;
}

void Initializer::choose_motion(const PointPairs& pairs, MeasuredMotion& motion) const {
  motion.is_decisive = false;
  const std::vector<InitialHypothesis> hypotheses =
      refined(plausible_hypotheses(motion, pairs, camera_), pairs);
  if (hypotheses.empty()) {
    return;
  }
  // Wrong matches cost every hypothesis the same: they are compared on what the best one explains.
  const PointTestResult first =
      test_points(hypotheses.front().cur_from_prev, pairs.prev_uv, pairs.cur_uv, camera_);
  const std::vector<InitialHypothesis> compared =
      refined(hypotheses, select(pairs, first.good_mask));
  const InitialHypothesis& best = compared.front();
  const auto rival =
      std::find_if(compared.begin(), compared.end(), [&](const InitialHypothesis& other) {
        return !is_same(other.cur_from_prev, best.cur_from_prev);
      });
  // Of few tracks a quarter must do.
  const PointTestOptions options{.parallax_rank = std::clamp(pairs.size() / 4, 1, 51)};
  const PointTestResult test =
      test_points(best.cur_from_prev, pairs.prev_uv, pairs.cur_uv, camera_, options);
  TwoViewMotion chosen;
  chosen.model = best.model;
  chosen.num_good = test.num_good;
  chosen.parallax_deg = test.parallax_deg;
  motion.model = best.model;
  motion.cur_from_prev = best.cur_from_prev;
  motion.inlier_mask = test.good_mask;
  two_view_.refine(pairs.prev_uv, pairs.cur_uv, motion);
  motion.is_decisive = is_decisive(chosen, pairs.size(), kAcceptance) &&
                       (rival == compared.end() || rival->cost > kMinMargin * best.cost);
}

std::optional<Window> Initializer::open_window(const View& now,
                                               const WindowOptions& window_options,
                                               const LocalizationOptions& localization) const {
  Window window;
  add_keyframe(window, {reference_.frame, reference_.world_from_camera, reference_.points, {}},
               window_options);
  add_keyframe(window, {now.frame, now.world_from_camera, now.points, {}}, window_options);
  triangulate_landmarks(window, camera_, window_options);
  if (static_cast<int>(window.landmarks.size()) < kMinLandmarks) {
    return std::nullopt;
  }
  Rigid3 predicted = reference_.world_from_camera;
  for (const View& view : waiting_) {
    const auto found =
        localize(find_seen_landmarks(window, view.points), predicted, camera_, localization);
    if (found.has_value()) {
      predicted = found->world_from_camera;
    }
    window.keyframes.front().followers.push_back(
        {view.frame, reference_.world_from_camera.inverse() * predicted});
  }
  return window;
}

void Initializer::wait(View view) {
  waiting_.push_back(std::move(view));
  if (waiting_.size() > kMaxWaiting) {
    waiting_.pop_front();
  }
}

}  // namespace stemvo
