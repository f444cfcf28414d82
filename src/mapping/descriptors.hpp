// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <functional>
#include <map>
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
/// corner. `scale`: as if the image were larger by that.
[[nodiscard]] std::vector<Descriptor> describe(const ChannelImage& channel,
                                               std::span<const KeptCorner> corners,
                                               double roll_rad,
                                               double scale = 1.0);

/// A frame is described in these ways, too, where nothing tells how it lies to what was seen: a
/// view from farther off looks like a smaller one, and the axes of a map that begins after a loss
/// are rolled against those of the map before.
struct OtherLook {
  double scale;
  double roll_rad;
};
inline constexpr std::array<double, 2> kOtherScales{0.7, 1.4};
inline constexpr std::array<OtherLook, 6> kOtherLooks{{{kOtherScales[0], 0.0},
                                                       {kOtherScales[1], 0.0},
                                                       {1.0, -0.2},
                                                       {1.0, 0.2},
                                                       {1.0, -0.4},
                                                       {1.0, 0.4}}};

/// Makes a frame's descriptors in another way.
using DescribeAs = std::function<std::vector<Descriptor>(const OtherLook& look)>;

/// A frame's descriptors in each way, made when they are asked for.
class LookDescriptors {
 public:
  /// Without `describe_as` there are no others than `as_is`.
  LookDescriptors(std::span<const Descriptor> as_is, const DescribeAs& describe_as)
      : as_is_(as_is), describe_as_(describe_as) {}

  [[nodiscard]] std::span<const Descriptor> as_is() const { return as_is_; }
  [[nodiscard]] std::span<const Descriptor> other(const OtherLook& look) {
    if (!describe_as_ || (look.scale == 1.0 && look.roll_rad == 0.0)) {
      return as_is_;
    }
    std::vector<Descriptor>& described = others_[{look.scale, look.roll_rad}];
    if (described.empty()) {
      described = describe_as_(look);
    }
    return described;
  }
  /// Descriptors like what is seen in a view which this one magnifies and turns.
  [[nodiscard]] std::span<const Descriptor> for_view(double magnification, double roll_rad);

 private:
  std::span<const Descriptor> as_is_;
  DescribeAs describe_as_;
  std::map<std::pair<double, double>, std::vector<Descriptor>> others_;
};

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
