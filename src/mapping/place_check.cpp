// SPDX-License-Identifier: MIT
#include "mapping/place_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "geometry/median.hpp"
#include "geometry/similarity_refinement.hpp"
#include "odometry/robust_models.hpp"

namespace stemvo {
namespace {

/// Fewer landmarks that agree, or in fewer of the image's cells, may do so by chance.
constexpr std::size_t kMinInliers = 30;
constexpr int kMinCells = 12;
constexpr int kColumns = 6;
constexpr int kRows = 4;
/// An inlier's reprojection error at a focal length of 718 px.
constexpr double kBound_px = 4.0;
constexpr double kFocal_px = 718.0;
/// So much of what either side agrees with, one similarity must explain.
constexpr double kMinAgreement = 0.7;
constexpr std::uint64_t kSeed = 1;
/// Errors of landmarks are alike: so many times the standard deviations of independent ones.
constexpr double kLoopSigmaFactor = 3.0;

double bound_px(const Camera& camera) {
  return std::max(2.0, kBound_px * camera.mean_focal_px() / kFocal_px);
}

/// Landmarks of one view that the other one's corners show.
struct Side {
  std::vector<DescriptorPair> pairs;  ///< corners of the one with landmarks, of the other
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> uv;
};

Side landmarks_seen(const PlaceView& of,
                    const PlaceView& by,
                    const std::vector<DescriptorPair>& pairs,
                    bool is_swapped) {
  Side side;
  for (const DescriptorPair& pair : pairs) {
    const auto mine = static_cast<std::size_t>(is_swapped ? pair.second : pair.first);
    const auto other = static_cast<std::size_t>(is_swapped ? pair.first : pair.second);
    if (of.corners[mine].has_landmark()) {
      side.pairs.push_back(pair);
      side.points.push_back(of.corners[mine].in_camera.cast<double>());
      side.uv.push_back(by.corners[other].uv.cast<double>());
    }
  }
  return side;
}

bool is_spread(const std::vector<Eigen::Vector2d>& uv, const Camera& camera) {
  std::vector<char> cells(static_cast<std::size_t>(kColumns * kRows));
  for (const Eigen::Vector2d& point : uv) {
    const int column =
        std::clamp(static_cast<int>(kColumns * point.x() / camera.width_px), 0, kColumns - 1);
    const int row =
        std::clamp(static_cast<int>(kRows * point.y() / camera.height_px), 0, kRows - 1);
    cells[static_cast<std::size_t>(row * kColumns + column)] = 1;
  }
  return std::ranges::count(cells, char{1}) >= kMinCells;
}

/// What agrees with a pose, and the pose refined on it; nullopt: too little.
struct Consensus {
  Rigid3 camera_from_points;
  Side inliers;
};

bool agrees(const Rigid3& camera_from_points,
            const Eigen::Vector3d& point,
            const Eigen::Vector2d& uv,
            const Camera& camera) {
  const Eigen::Vector3d x = camera_from_points * point;
  return x.z() > 0.0 && (camera.project(x) - uv).norm() <= bound_px(camera);
}

std::optional<Consensus> find_consensus(const Side& side, const Camera& camera) {
  if (side.uv.size() < kMinInliers) {
    return std::nullopt;
  }
  const std::optional<Rigid3> start =
      estimate_absolute_pose(side.points, side.uv, camera, bound_px(camera), kSeed);
  if (!start.has_value()) {
    return std::nullopt;
  }
  Consensus consensus;
  consensus.camera_from_points =
      refine_absolute_pose(*start, side.points, side.uv, camera, {.loss_scale_px = 1.0});
  for (std::size_t i = 0; i < side.uv.size(); ++i) {
    if (agrees(consensus.camera_from_points, side.points[i], side.uv[i], camera)) {
      consensus.inliers.pairs.push_back(side.pairs[i]);
      consensus.inliers.points.push_back(side.points[i]);
      consensus.inliers.uv.push_back(side.uv[i]);
    }
  }
  if (consensus.inliers.uv.size() < kMinInliers || !is_spread(consensus.inliers.uv, camera)) {
    return std::nullopt;
  }
  return consensus;
}

}  // namespace

std::optional<PlacePose> locate_in_place(const PlaceView& old, const PlaceView& frame) {
  const auto pairs = match_descriptors(old.descriptors, frame.descriptors);
  auto found = find_consensus(landmarks_seen(old, frame, pairs, false), frame.camera);
  if (!found.has_value()) {
    return std::nullopt;
  }
  return PlacePose{found->camera_from_points.inverse(), std::move(found->inliers.pairs)};
}

std::optional<Loop> check_place(const PlaceView& old, const PlaceView& recent) {
  const auto pairs = match_descriptors(old.descriptors, recent.descriptors);
  const auto on_old = find_consensus(landmarks_seen(old, recent, pairs, false), recent.camera);
  if (!on_old.has_value()) {
    return std::nullopt;
  }
  const auto on_recent = find_consensus(landmarks_seen(recent, old, pairs, true), old.camera);
  if (!on_recent.has_value()) {
    return std::nullopt;
  }
  // The scale, by landmarks that both have.
  const Rigid3 old_from_recent = on_old->camera_from_points.inverse();
  std::vector<double> ratios;
  for (const auto& [mine, other] : on_old->inliers.pairs) {
    const KeptCorner& corner = recent.corners[static_cast<std::size_t>(other)];
    if (corner.has_landmark()) {
      const Eigen::Vector3d point =
          old.corners[static_cast<std::size_t>(mine)].in_camera.cast<double>();
      ratios.push_back((on_old->camera_from_points * point).norm() /
                       corner.in_camera.cast<double>().norm());
    }
  }
  if (ratios.size() < kMinInliers) {
    return std::nullopt;
  }
  CrossObservations seen{old.camera, recent.camera, {}, {}};
  for (std::size_t i = 0; i < on_old->inliers.uv.size(); ++i) {
    seen.of_a.push_back({on_old->inliers.points[i], on_old->inliers.uv[i]});
  }
  for (std::size_t i = 0; i < on_recent->inliers.uv.size(); ++i) {
    seen.of_b.push_back({on_recent->inliers.points[i], on_recent->inliers.uv[i]});
  }
  const RefinedSimilarity refined =
      refine_similarity({median(ratios), old_from_recent.rotation, old_from_recent.translation},
                        seen, {.loss_scale_px = 1.0});
  // One similarity for both.
  const Similarity3& similarity = refined.a_from_b;
  const Similarity3 back = similarity.inverse();
  Loop loop;
  loop.from_to = similarity;
  std::vector<Eigen::Vector2d> uv;
  std::vector<double> errors_px;
  for (const auto& [mine, other] : on_old->inliers.pairs) {
    const KeptCorner& from = old.corners[static_cast<std::size_t>(mine)];
    const KeptCorner& to = recent.corners[static_cast<std::size_t>(other)];
    const Eigen::Vector3d in_recent = back * Eigen::Vector3d(from.in_camera.cast<double>());
    const Eigen::Vector3d in_old = similarity * Eigen::Vector3d(to.in_camera.cast<double>());
    if (!to.has_landmark() || in_old.z() <= 0.0 || in_recent.z() <= 0.0) {
      continue;
    }
    const double error = (recent.camera.project(in_recent) - to.uv.cast<double>()).norm();
    const double back_error = (old.camera.project(in_old) - from.uv.cast<double>()).norm();
    if (error <= bound_px(recent.camera) && back_error <= bound_px(old.camera)) {
      loop.corners.emplace_back(mine, other);
      uv.emplace_back(to.uv.cast<double>());
      errors_px.push_back(error);
      errors_px.push_back(back_error);
    }
  }
  const std::size_t most = std::max(on_old->inliers.uv.size(), on_recent->inliers.uv.size());
  if (uv.size() < kMinInliers || !is_spread(uv, recent.camera) ||
      static_cast<double>(uv.size()) < kMinAgreement * static_cast<double>(most)) {
    return std::nullopt;
  }
  const double noise_px = kLoopSigmaFactor * median(std::move(errors_px));
  const auto sigma = [&](int first, int count) {
    return noise_px * std::sqrt(refined.covariance.diagonal().segment(first, count).mean());
  };
  loop.sigma_rad = sigma(0, 3);
  loop.sigma_translation = sigma(3, 3);
  loop.sigma_log_scale = sigma(6, 1);
  return loop;
}

}  // namespace stemvo
