// SPDX-License-Identifier: MIT
#include "mapping/expected_views.hpp"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <utility>

#include "geometry/median.hpp"

namespace stemvo {
namespace {

/// Views that share less are hard to match.
constexpr double kMinShare = 0.3;
/// So many corners stand for all.
constexpr std::size_t kSamples = 64;

bool is_inside(const Eigen::Vector2d& uv, const Camera& camera) {
  return uv.x() >= 0.0 && uv.y() >= 0.0 && uv.x() < camera.width_px && uv.y() < camera.height_px;
}

struct SharedView {
  double share = 0.0;  ///< of the landmarks
  double magnification = 1.0;
};

/// How much `by` sees of the landmarks of `of`, and how large.
SharedView shared_view(const KeptKeyframe& of,
                       const KeptKeyframe& by,
                       const Similarity3& by_from_of) {
  int num_landmarks = 0;
  std::vector<double> nearer;
  const std::size_t step = 1 + of.corners.size() / kSamples;
  for (std::size_t i = 0; i < of.corners.size(); i += step) {
    if (!of.corners[i].has_landmark()) {
      continue;
    }
    ++num_landmarks;
    const Eigen::Vector3d point = of.corners[i].in_camera.cast<double>();
    const Eigen::Vector3d x = by_from_of * point;
    if (x.z() > 0.0 && is_inside(by.camera.project(x), by.camera)) {
      nearer.push_back(by_from_of.scale * point.z() / x.z());
    }
  }
  if (nearer.empty()) {
    return {};
  }
  const double share = static_cast<double>(nearer.size()) / num_landmarks;
  return {share, median(std::move(nearer)) * by.camera.mean_focal_px() / of.camera.mean_focal_px()};
}

}  // namespace

std::vector<ExpectedView> expected_views(const KeptMap& map,
                                         std::span<const int> places,
                                         int number,
                                         const KeptKeyframe& keyframe) {
  const auto pose_of = [&](int node) -> const Similarity3& {
    return map.map_from_keyframe[slot(node)];
  };
  std::vector<ExpectedView> views;
  for (const int place : places) {
    const KeptKeyframe& old = map.keyframes[slot(place)];
    const Similarity3 motion = pose_of(number).inverse() * pose_of(place);
    const SharedView there = shared_view(old, keyframe, motion);
    if (there.share < kMinShare) {
      continue;
    }
    const double share = std::min(there.share, shared_view(keyframe, old, motion.inverse()).share);
    if (share >= kMinShare) {
      views.push_back({place, motion, share, there.magnification});
    }
  }
  std::ranges::stable_sort(views, std::greater<>(), &ExpectedView::share);
  return views;
}

}  // namespace stemvo
