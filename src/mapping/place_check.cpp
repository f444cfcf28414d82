// SPDX-License-Identifier: MIT
#include "mapping/place_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "geometry/median.hpp"
#include "geometry/pose_refinement.hpp"
#include "odometry/robust_models.hpp"

namespace stemvo {
namespace {

/// Fewer landmarks that agree, or in fewer of the image's cells, or of the pairs that P3P was
/// given, may do so by chance.
struct Least {
  std::size_t num_inliers = 30;
  int num_cells = 12;
  double share = 0.0;
  double agreement = 0.7;  ///< of what either side found alone, that one similarity must explain
};
/// Where they were looked for, some are found of anything.
constexpr Least kLeastBySighting{30, 12, 0.4};
/// The poses say already that it is the place.
constexpr Least kLeastByPoses{15, 6, 0.25, 0.6};
constexpr int kColumns = 6;
constexpr int kRows = 4;
/// So many of so many pairs or more are enough to look for more where a pose has them.
constexpr std::size_t kMinMatches = 16;
constexpr std::size_t kMinSample = 10;
/// An inlier's reprojection error, at a focal length of 718 px; least of a small image.
constexpr double kBound_px = 4.0;
constexpr double kMinBound_px = 3.0;
/// P3P, and the search for more, allow so many times that.
constexpr double kLooseBound = 2.0;
constexpr double kFocal_px = 718.0;
/// A young landmark's depth may be wrong by this share: it lies on a piece of its ray.
constexpr double kDepthError = 0.15;
/// Cauchy scale: corners that were detected twice are off by about that.
constexpr double kLoss_px = 1.0;
/// Bits in which a landmark differs from a corner near its projection.
constexpr int kGuidedBits = 80;
constexpr std::uint64_t kSeed = 1;
/// Errors of landmarks are alike: so many times the standard deviations of independent ones.
constexpr double kLoopSigmaFactor = 3.0;

double bound_px(const Camera& camera) {
  return std::max(kMinBound_px, kBound_px * camera.mean_focal_px() / kFocal_px);
}

const KeptCorner& corner_of(const PlaceView& view, int index) { return view.corners[slot(index)]; }
Eigen::Vector3d landmark_of(const PlaceView& view, int index) {
  return corner_of(view, index).in_camera.cast<double>();
}
Eigen::Vector2d uv_of(const PlaceView& view, int index) {
  return corner_of(view, index).uv.cast<double>();
}

/// Cells of the image of `by` in which pairs are.
int num_cells(const PlaceView& by, const std::vector<DescriptorPair>& pairs) {
  std::vector<char> cells(static_cast<std::size_t>(kColumns * kRows));
  for (const auto& [mine, other] : pairs) {
    const Eigen::Vector2d point = uv_of(by, other);
    const int column =
        std::clamp(static_cast<int>(kColumns * point.x() / by.camera.width_px), 0, kColumns - 1);
    const int row =
        std::clamp(static_cast<int>(kRows * point.y() / by.camera.height_px), 0, kRows - 1);
    cells[static_cast<std::size_t>(row * kColumns + column)] = 1;
  }
  return static_cast<int>(std::ranges::count(cells, char{1}));
}

/// Where a view has the landmark of another one, whose depth may be wrong.
struct Piece {
  Eigen::Vector2d from;
  Eigen::Vector2d way;

  [[nodiscard]] double distance_px(const Eigen::Vector2d& uv) const {
    const Eigen::Vector2d to = uv - from;
    return (to - std::clamp(to.dot(way) / std::max(way.squaredNorm(), 1e-12), 0.0, 1.0) * way)
        .norm();
  }
};

/// nullopt: behind the camera.
std::optional<Piece> piece_of(const Similarity3& by_from_of,
                              const Eigen::Vector3d& landmark,
                              const Camera& by) {
  const Eigen::Vector3d near = by_from_of * ((1.0 - kDepthError) * landmark);
  const Eigen::Vector3d far = by_from_of * ((1.0 + kDepthError) * landmark);
  if (std::min(near.z(), far.z()) <= 0.0) {
    return std::nullopt;
  }
  const Eigen::Vector2d from = by.project(near);
  return Piece{from, by.project(far) - from};
}

/// Sightings of one view's landmarks by the other one.
bool is_seen(
    const Similarity3& by_from_of, const PlaceView& of, int mine, const PlaceView& by, int other) {
  const auto piece = piece_of(by_from_of, landmark_of(of, mine), by.camera);
  return piece && piece->distance_px(uv_of(by, other)) <= bound_px(by.camera);
}

/// Landmarks of `of` where `by` has corners like them near the pieces of their rays: each other's
/// nearest.
std::vector<DescriptorPair> match_near(const Similarity3& by_from_of,
                                       const PlaceView& of,
                                       const PlaceView& by,
                                       double radius_px) {
  struct Best {
    int mine = -1;
    int num_bits = kGuidedBits + 1;
  };
  std::vector<Best> best(by.corners.size());
  for (std::size_t i = 0; i < of.corners.size(); ++i) {
    const int mine = static_cast<int>(i);
    if (!of.corners[i].has_landmark() || of.descriptors[i] == kNoDescriptor) {
      continue;
    }
    const auto piece = piece_of(by_from_of, landmark_of(of, mine), by.camera);
    if (!piece) {
      continue;
    }
    int nearest = -1;
    int least = kGuidedBits + 1;
    for (std::size_t j = 0; j < by.corners.size(); ++j) {
      if (by.descriptors[j] != kNoDescriptor &&
          piece->distance_px(uv_of(by, static_cast<int>(j))) <= radius_px) {
        const int num_bits = differing_bits(of.descriptors[i], by.descriptors[j]);
        if (num_bits < least) {
          least = num_bits;
          nearest = static_cast<int>(j);
        }
      }
    }
    if (nearest >= 0 && least < best[slot(nearest)].num_bits) {
      best[slot(nearest)] = {mine, least};
    }
  }
  std::vector<DescriptorPair> pairs;
  for (std::size_t j = 0; j < best.size(); ++j) {
    if (best[j].mine >= 0) {
      pairs.emplace_back(best[j].mine, static_cast<int>(j));
    }
  }
  return pairs;
}

std::vector<DescriptorPair> swapped(std::vector<DescriptorPair> pairs) {
  for (auto& [first, second] : pairs) {
    std::swap(first, second);
  }
  return pairs;
}

struct Consensus {
  Rigid3 by_from_of;
  std::vector<DescriptorPair> inliers;
};

/// The pose that most of the pairs with landmarks of `of` agree with; nullopt: too few.
std::optional<Consensus> find_consensus(const PlaceView& of,
                                        const PlaceView& by,
                                        const std::vector<DescriptorPair>& pairs) {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> uv;
  for (const auto& [mine, other] : pairs) {
    if (corner_of(of, mine).has_landmark()) {
      points.push_back(landmark_of(of, mine));
      uv.push_back(uv_of(by, other));
    }
  }
  if (uv.size() < kMinMatches) {
    return std::nullopt;
  }
  const auto start =
      estimate_absolute_pose(points, uv, by.camera, kLooseBound * bound_px(by.camera), kSeed);
  if (!start.has_value()) {
    return std::nullopt;
  }
  Consensus consensus{
      refine_absolute_pose(*start, points, uv, by.camera, {.loss_scale_px = kLoss_px}), {}};
  const Similarity3 by_from_of(consensus.by_from_of);
  for (const DescriptorPair& pair : pairs) {
    if (corner_of(of, pair.first).has_landmark() &&
        is_seen(by_from_of, of, pair.first, by, pair.second)) {
      consensus.inliers.push_back(pair);
    }
  }
  return consensus.inliers.size() < kMinSample ? std::nullopt : std::optional(consensus);
}

/// The median ratio of distances of landmarks that both have; nullopt: too few.
std::optional<double> scale_between(const PlaceView& old,
                                    const PlaceView& recent,
                                    const Consensus& on_old) {
  std::vector<double> ratios;
  for (const auto& [mine, other] : on_old.inliers) {
    if (corner_of(recent, other).has_landmark()) {
      ratios.push_back((on_old.by_from_of * landmark_of(old, mine)).norm() /
                       landmark_of(recent, other).norm());
    }
  }
  return ratios.size() < kMinSample ? std::nullopt : std::optional(median(std::move(ratios)));
}

/// Refines on what either one sees of the other's landmarks.
RefinedSimilarity refine(const Similarity3& old_from_recent,
                         const PlaceView& old,
                         const PlaceView& recent,
                         const std::vector<DescriptorPair>& on_old,
                         const std::vector<DescriptorPair>& on_recent) {
  CrossObservations seen{old.camera, recent.camera, {}, {}};
  for (const auto& [mine, other] : on_old) {
    seen.of_a.push_back({landmark_of(old, mine), uv_of(recent, other)});
  }
  for (const auto& [mine, other] : on_recent) {
    seen.of_b.push_back({landmark_of(recent, mine), uv_of(old, other)});
  }
  return refine_similarity(old_from_recent, seen, {.loss_scale_px = kLoss_px});
}

/// The pairs whose landmarks, one or both, are seen where they are.
std::vector<DescriptorPair> agreeing(const Similarity3& old_from_recent,
                                     const PlaceView& old,
                                     const PlaceView& recent,
                                     const std::vector<DescriptorPair>& pairs) {
  const Similarity3 recent_from_old = old_from_recent.inverse();
  std::vector<DescriptorPair> inliers;
  for (const DescriptorPair& pair : pairs) {
    const auto& [mine, other] = pair;
    if ((!corner_of(old, mine).has_landmark() ||
         is_seen(recent_from_old, old, mine, recent, other)) &&
        (!corner_of(recent, other).has_landmark() ||
         is_seen(old_from_recent, recent, other, old, mine))) {
      inliers.push_back(pair);
    }
  }
  return inliers;
}

bool is_enough(const PlaceView& by,
               const std::vector<DescriptorPair>& inliers,
               const Least& least) {
  return inliers.size() >= least.num_inliers && num_cells(by, inliers) >= least.num_cells;
}

double median_error_px(const Similarity3& recent_from_old,
                       const PlaceView& old,
                       const PlaceView& recent,
                       const std::vector<DescriptorPair>& pairs) {
  std::vector<double> errors_px;
  for (const auto& [mine, other] : pairs) {
    errors_px.push_back(
        (recent.camera.project(recent_from_old * landmark_of(old, mine)) - uv_of(recent, other))
            .norm());
  }
  return median(std::move(errors_px));
}

}  // namespace

std::optional<Expectation> expect_by_places(const Camera& camera,
                                            std::span<const PlaceAround> around,
                                            const PlaceView& recent) {
  std::vector<KeptCorner> landmarks;
  std::vector<DescriptorPair> pairs;
  // Each is matched alone: where two show one landmark, neither would be clearly the nearest.
  for (const auto& [place_from_it, view] : around) {
    for (const auto& [mine, other] : match_descriptors(view.descriptors, recent.descriptors)) {
      const Eigen::Vector3d landmark = place_from_it * landmark_of(view, mine);
      if (landmark.z() > 0.0) {  // not NaN, which stands for none
        pairs.emplace_back(static_cast<int>(landmarks.size()), other);
        landmarks.push_back({-1, camera.project(landmark).cast<float>(), landmark.cast<float>()});
      }
    }
  }
  const PlaceView all{camera, landmarks, {}};
  const auto found = find_consensus(all, recent, pairs);
  const auto scale = found.has_value() ? scale_between(all, recent, *found) : std::nullopt;
  if (!scale.has_value()) {
    return std::nullopt;
  }
  const Rigid3 place_from_recent = found->by_from_of.inverse();
  return Expectation{
      Similarity3(*scale, place_from_recent.rotation, place_from_recent.translation).inverse(),
      Expectation::kBySighting_rad, false};
}

std::optional<LocatedFrame> locate_in_place(const PlaceView& old, const PlaceView& frame) {
  auto found = find_consensus(old, frame, match_descriptors(old.descriptors, frame.descriptors));
  if (!found.has_value()) {
    return std::nullopt;
  }
  found = find_consensus(
      old, frame,
      match_near(Similarity3(found->by_from_of), old, frame, kLooseBound * bound_px(frame.camera)));
  if (!found.has_value() || !is_enough(frame, found->inliers, {})) {
    return std::nullopt;
  }
  LocatedFrame located{-1, found->by_from_of.inverse(), {}};
  for (const auto& [mine, other] : found->inliers) {
    located.landmarks.emplace_back(corner_of(frame, other).track_id, landmark_of(old, mine));
  }
  return located;
}

std::optional<Loop> check_place(const PlaceView& old,
                                const PlaceView& recent,
                                const std::optional<Expectation>& expected) {
  const auto pairs = expected.has_value()
                         ? match_near(expected->recent_from_old, old, recent,
                                      expected->search_rad * recent.camera.mean_focal_px())
                         : match_descriptors(old.descriptors, recent.descriptors);
  const auto on_old = find_consensus(old, recent, pairs);
  if (!on_old.has_value()) {
    return std::nullopt;
  }
  const auto on_recent = find_consensus(recent, old, swapped(pairs));
  const auto scale = scale_between(old, recent, *on_old);
  if (!on_recent.has_value() || !scale.has_value()) {
    return std::nullopt;
  }
  const Rigid3 start = on_old->by_from_of.inverse();
  const Similarity3 first = refine({*scale, start.rotation, start.translation}, old, recent,
                                   on_old->inliers, on_recent->inliers)
                                .a_from_b;
  // More of them, where the first similarity has them.
  const auto near =
      agreeing(first, old, recent,
               match_near(first.inverse(), old, recent, kLooseBound * bound_px(recent.camera)));
  std::vector<DescriptorPair> back;
  for (const auto& [mine, other] : near) {
    if (corner_of(recent, other).has_landmark()) {
      back.emplace_back(other, mine);
    }
  }
  const RefinedSimilarity refined = refine(first, old, recent, near, back);
  Loop loop;
  loop.from_to = refined.a_from_b;
  loop.corners = agreeing(loop.from_to, old, recent, near);
  const Least least = !expected.has_value()  ? Least()
                      : expected->is_certain ? kLeastByPoses
                                             : kLeastBySighting;
  const auto explained = [&](const std::vector<DescriptorPair>& found) {
    return static_cast<double>(agreeing(loop.from_to, old, recent, found).size()) >=
           least.agreement * static_cast<double>(found.size());
  };
  if (!is_enough(recent, loop.corners, least) || back.size() < least.num_inliers ||
      static_cast<double>(on_old->inliers.size()) <
          least.share * static_cast<double>(pairs.size()) ||
      !explained(on_old->inliers) || !explained(swapped(on_recent->inliers))) {
    return std::nullopt;
  }
  const double noise_px =
      kLoopSigmaFactor * median_error_px(loop.from_to.inverse(), old, recent, loop.corners);
  const auto sigma = [&](int first_row, int count) {
    return noise_px * std::sqrt(refined.covariance.diagonal().segment(first_row, count).mean());
  };
  loop.sigma_rad = sigma(0, 3);
  loop.sigma_translation = sigma(3, 3);
  loop.sigma_log_scale = sigma(6, 1);
  return loop;
}

}  // namespace stemvo
