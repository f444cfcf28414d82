// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <vector>

#include "mapping/kept_map.hpp"

namespace stemvo {

struct MapView {
  int keyframe = 0;
  int corner = 0;
};

/// The views of one landmark: at least two views, ordered by keyframe, one of each.
using MapTrack = std::vector<MapView>;

/// Corners of one track id in keyframes that follow each other, and those that loops connect. A
/// loop that the graph contradicts connects nothing.
[[nodiscard]] std::vector<MapTrack> tracks_of(const KeptMap& map);

/// None all of whose keyframes have `share` views of others that were taken before. The longest
/// come first; with `max_views`, any: tracks are cut into pieces of no more views, at least three,
/// and their order is that of a fixed hash.
[[nodiscard]] std::vector<MapTrack> choose_tracks(std::vector<MapTrack> tracks,
                                                  std::size_t num_keyframes,
                                                  std::size_t share,
                                                  std::size_t max_views);

}  // namespace stemvo
