// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "mapping/descriptors.hpp"
#include "mapping/kept_map.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A frame that may show a kept place: corners, with landmarks or without, and one descriptor each.
struct PlaceView {
  Camera camera;
  std::span<const KeptCorner> corners;
  std::span<const Descriptor> descriptors;
};

/// A lost frame, found.
struct LocatedFrame {
  int keyframe = 0;             ///< the old one's number in the map
  Rigid3 keyframe_from_camera;  ///< in the old one's unit
  /// A track of the frame, and its landmark in the old keyframe's camera.
  std::vector<std::pair<int, Eigen::Vector3d>> landmarks;
};

/// Pose of a frame by the landmarks of an old keyframe that its descriptors find: consensus of
/// samples of three (P3P) from a fixed seed, refined. The result's `keyframe` is not set. nullopt:
/// fewer than 30 agree, or they lie in a small part of the image.
[[nodiscard]] std::optional<LocatedFrame> locate_in_place(const PlaceView& old,
                                                          const PlaceView& frame);

/// Where a new keyframe should lie to an old one.
struct Expectation {
  /// By the map's poses; by a keyframe that was sighted.
  static constexpr double kByPoses_rad = 0.075;
  static constexpr double kBySighting_rad = 0.025;

  Similarity3 recent_from_old;
  double search_rad = kByPoses_rad;  ///< how far from where a landmark should be it may be
  bool is_certain = true;            ///< poses say that they show one place: fewer are enough
};

/// An old keyframe beside a place.
struct PlaceAround {
  Similarity3 place_from_it;
  PlaceView view;
};

/// Where a new keyframe lies to a place, whose camera is given, by the landmarks of all that stand
/// around it, itself too: each alone may have too few that look alike. nullopt: too few agree.
[[nodiscard]] std::optional<Expectation> expect_by_places(const Camera& camera,
                                                          std::span<const PlaceAround> around,
                                                          const PlaceView& recent);

/// The similarity between two keyframes that see the same landmarks, each with its own idea of
/// where they are: `old` on the new one's, the new one on the old ones, both agreeing, then one
/// similarity refined on both images. The result's `from` and `to` are not set. nullopt: the two do
/// not show one place.
/// With `expected` corners are matched near where the landmarks should be.
[[nodiscard]] std::optional<Loop> check_place(const PlaceView& old,
                                              const PlaceView& recent,
                                              const std::optional<Expectation>& expected = {});

}  // namespace stemvo
