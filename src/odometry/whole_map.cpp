// SPDX-License-Identifier: MIT
#include "odometry/whole_map.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>

#include <fmt/format.h>

#include "geometry/radial_lens.hpp"
#include "mapping/pose_graph.hpp"
#include "odometry/self_calibration.hpp"

namespace stemvo {
namespace {

Rigid3 pose_of(const Similarity3& placed) { return {placed.rotation, placed.translation}; }

/// Places that are seen again, from elsewhere, tell a camera that nobody knows: focal length
/// (share), k1, k2.
constexpr double kFreeFocal = 0.1;
constexpr double kFreeDistortion = 0.05;

/// No keyframe was turned against what was measured between it and the next one.
bool agrees_with_motions(const KeptMap& kept, const std::vector<Similarity3>& map_from_keyframe) {
  constexpr double kMaxTurn_rad = 0.035;
  constexpr double kMaxSigmas = 10.0;
  return std::ranges::all_of(kept.motions, [&](const MapEdge& edge) {
    const Eigen::Quaterniond turn = map_from_keyframe[slot(edge.from)].rotation.conjugate() *
                                    map_from_keyframe[slot(edge.to)].rotation;
    return turn.angularDistance(edge.from_to.rotation) <
           std::max(kMaxTurn_rad, kMaxSigmas * edge.sigma_rad);
  });
}

}  // namespace

WholeMap::WholeMap(const PhasedOdometry& odometry)
    : kept(odometry.frames().estimator().kept_map()),
      landmarks(odometry.frames().estimator().landmarks_since(0).landmarks),
      trajectory(odometry.frames().estimator().trajectory()),
      times_s(odometry.frames().times_s()),
      map_from_frame(place_trajectory(trajectory, times_s, kept)),
      camera(kept.keyframes.empty() ? odometry.view().camera() : kept.keyframes.back().camera),
      camera_sigma(prior_sigma(odometry.options().camera.refine)),
      prior(camera_sigma) {
  if (const auto learnt = odometry.frames().estimator().camera_estimate(); learnt && camera_sigma) {
    camera_sigma->head<3>() = camera_sigma->head<3>().cwiseMin(learnt->sigma.head<3>());
    if (kept.loops.empty()) {
      prior = camera_sigma;
    } else {
      prior->tail<3>() << kFreeFocal, kFreeDistortion, kFreeDistortion;
    }
  }
}

void WholeMap::close_loops() {
  if (!kept.loops.empty()) {
    solve_pose_graph(kept);
    map_from_frame = place_trajectory(trajectory, times_s, kept);
  }
}

Status WholeMap::adjust(const std::vector<int>& frames, bool has_sigmas) {
  for (const int frame : frames) {
    const auto found = std::ranges::lower_bound(kept.keyframes, frame, {}, &KeptKeyframe::frame);
    if (found == kept.keyframes.end() || found->frame != frame) {
      return fail(fmt::format("covariance_of: expected frames of keyframes, found {}", frame));
    }
    covariance_of.push_back(static_cast<int>(found - kept.keyframes.begin()));
  }
  close_loops();
  const auto is_of_other = [](const KeptKeyframe& keyframe) { return keyframe.frame < 0; };
  const auto num_of_other = std::ranges::count_if(kept.keyframes, is_of_other);
  constexpr std::size_t kMaxViews = 12;
  const auto adjusted = adjust_map(
      kept, {camera, prior, static_cast<int>(num_of_other), covariance_of, kMaxViews, has_sigmas});
  if (adjusted && agrees_with_motions(kept, adjusted->map_from_keyframe)) {
    take_in(*adjusted);
  } else {
    covariance_of.clear();
  }
  map_from_frame = place_trajectory(trajectory, times_s, kept);
  return {};
}

void WholeMap::take_in(const MapAdjustment& adjusted) {
  kept.map_from_keyframe = adjusted.map_from_keyframe;
  covariances = adjusted.covariances;
  for (const AdjustedLandmark& landmark : adjusted.landmarks) {
    for (const MapView& view : landmark.views) {
      const Eigen::Vector3d in_camera =
          kept.map_from_keyframe[slot(view.keyframe)].inverse() * landmark.in_map;
      if (in_camera.allFinite() && in_camera.z() > 0.0) {
        kept.keyframes[slot(view.keyframe)].corners[slot(view.corner)].in_camera =
            in_camera.cast<float>();
      }
    }
  }
  if (!camera_sigma) {
    return;
  }
  const IntrinsicsDelta& change = adjusted.camera.change;
  camera = changed(camera, change);
  camera_sigma = adjusted.camera.sigma;  // 0: nobody asked
  for (KeptKeyframe& keyframe : kept.keyframes) {
    if (keyframe.frame < 0) {
      continue;
    }
    const RadialLens before = radial_lens(keyframe.camera, keyframe.radial);
    keyframe.camera = camera;
    keyframe.radial = change.tail<2>();
    const RadialLens after = radial_lens(keyframe.camera, keyframe.radial);
    for (KeptCorner& corner : keyframe.corners) {
      corner.uv = after.undistort(before.distort(corner.uv.cast<double>())).cast<float>();
    }
  }
}

AdjustedMap WholeMap::answer() const {
  AdjustedMap map;
  map.camera = camera;
  if (camera_sigma) {
    map.camera_sigma = {(*camera_sigma)[2] * camera.fx_px, (*camera_sigma)[0], (*camera_sigma)[1]};
  }
  std::ranges::transform(map_from_frame, std::back_inserter(map.map_from_camera), pose_of);
  for (std::size_t i = 0; i < kept.keyframes.size(); ++i) {
    const KeptKeyframe& keyframe = kept.keyframes[i];
    const bool is_own = keyframe.frame >= 0;  // another recording's clock is its own
    map.keyframes.push_back({keyframe.frame,
                             is_own ? times_s[slot(keyframe.frame)] : keyframe.time_s,
                             pose_of(kept.map_from_keyframe[i])});
  }
  for (std::size_t i = 0; i < covariance_of.size(); ++i) {
    if (covariances[i].trace() > 0.0) {  // else it could not be found
      map.keyframes[slot(covariance_of[i])].covariance = covariances[i];
    }
  }
  for (const KeptLandmark& landmark : landmarks) {
    map.landmarks.push_back(
        {landmark.id, map_from_frame[slot(landmark.frame)] * landmark.in_camera.cast<double>(),
         landmark.rgb});
  }
  for (const auto& [from, to] : frames_of_loops(kept)) {
    map.loops.push_back({from, to});
  }
  return map;
}

}  // namespace stemvo
