// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "mapping/kept_map.hpp"

namespace stemvo {

/// A corner of a keyframe.
struct MapView {
  int keyframe = 0;
  int corner = 0;
};

/// What keyframes see of one landmark: at least two views, ordered by keyframe, one of each.
using MapTrack = std::vector<MapView>;

/// Corners of one track id in keyframes that follow each other, and those that loops connect. A
/// loop that the graph contradicts connects nothing.
[[nodiscard]] std::vector<MapTrack> tracks_of(const KeptMap& map);

}  // namespace stemvo
