// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include "mapping/kept_map.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A place that a keyframe shows in part, if both are where the map has them.
struct ExpectedView {
  int place = 0;  ///< number of its keyframe
  Similarity3 keyframe_from_place;
  double share = 0.0;          ///< of the landmarks of either one that the other one sees
  double magnification = 1.0;  ///< of the keyframe's view to the place's
};

/// Picks the `places` that share enough of the view with the map's keyframe `number`, whose corners
/// `keyframe` has. The most first.
[[nodiscard]] std::vector<ExpectedView> expected_views(const KeptMap& map,
                                                       std::span<const int> places,
                                                       int number,
                                                       const KeptKeyframe& keyframe);

}  // namespace stemvo
