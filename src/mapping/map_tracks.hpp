// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <vector>

#include "mapping/kept_map.hpp"

namespace stemvo {

/// A corner of a keyframe.
struct MapView {
  int keyframe = 0;
  int corner = 0;
};

/// The views of one landmark: at least two views, ordered by keyframe, one of each.
using MapTrack = std::vector<MapView>;

/// Corners of one track id in keyframes that follow each other, and those that loops connect. A
/// loop that the graph contradicts connects nothing.
[[nodiscard]] std::vector<MapTrack> tracks_of(const KeptMap& map);

/// The longest tracks: none all of whose keyframes have `share` views of longer ones.
[[nodiscard]] std::vector<MapTrack> longest_tracks(std::vector<MapTrack> tracks,
                                                   std::size_t num_keyframes,
                                                   std::size_t share);

}  // namespace stemvo
