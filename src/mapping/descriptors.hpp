// SPDX-License-Identifier: MIT
#pragma once

#include <bit>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "instruction_set.hpp"
#include "mapping/kept_map.hpp"
#include "stem/channel.hpp"

namespace stemvo {

/// Stands for a corner too near the border; it matches nothing.
inline constexpr Descriptor kNoDescriptor{};

/// From the image's y axis to where the map's y axis points in it.
[[nodiscard]] double image_roll_rad(const Eigen::Quaterniond& map_from_camera);

/// ORB's 256 comparisons around each corner on the channel, turned with the image: a hand rolls the
/// camera by 15 degrees, and a turn that is not measured at each corner costs no bits. One per
/// corner.
[[nodiscard]] std::vector<Descriptor> describe(const ChannelImage& channel,
                                               std::span<const KeptCorner> corners,
                                               double roll_rad);

/// Bits that differ; inside of what is compiled for a processor that counts bits, it does.
STEMVO_INLINE int differing_bits(const Descriptor& a, const Descriptor& b) {
  int num_bits = 0;
  for (std::size_t word = 0; word < a.size(); ++word) {
    num_bits += std::popcount(a[word] ^ b[word]);
  }
  return num_bits;
}

/// Index of a descriptor of one frame, of one of another.
using DescriptorPair = std::pair<int, int>;

/// Pairs that are each other's nearest, within a bound, and clearly nearer than the next one.
[[nodiscard]] std::vector<DescriptorPair> match_descriptors(std::span<const Descriptor> first,
                                                            std::span<const Descriptor> second);

}  // namespace stemvo
