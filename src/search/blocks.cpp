// SPDX-License-Identifier: MIT
#include "search/blocks.hpp"

#include <algorithm>
#include <numeric>

namespace stemvo::search {
namespace {

using Blocks = std::vector<std::vector<std::size_t>>;

/// Two frames' floats.
constexpr std::size_t kChannelBytesPerPixel = 2 * sizeof(float);
/// A gray value and two derivatives of 16 bits on each level of the pyramid, 4/3 of the first one's
/// pixels in all; the picture itself; what a thread works in.
constexpr std::size_t kPictureBytesPerPixel = 8;
constexpr std::size_t kPathBytes = std::size_t{1} << 17;

std::vector<std::size_t> indices(std::size_t begin, std::size_t end) {
  std::vector<std::size_t> block(end - begin);
  std::iota(block.begin(), block.end(), begin);
  return block;
}

/// Parts whose sizes differ by at most 1.
void cut_evenly(std::size_t begin, std::size_t end, std::size_t num_parts, Blocks& blocks) {
  for (std::size_t i = 0; i < num_parts; ++i) {
    blocks.push_back(indices(begin + i * (end - begin) / num_parts,
                             begin + (i + 1) * (end - begin) / num_parts));
  }
}

Blocks cut_by_number(std::size_t count, std::size_t num_filters) {
  Blocks blocks;
  for (std::size_t begin = 0; begin < count; begin += num_filters) {
    blocks.push_back(indices(begin, std::min(begin + num_filters, count)));
  }
  return blocks;
}

}  // namespace

std::size_t bytes_in_flight(cv::Size channel, cv::Size picture, std::size_t num_sequences) {
  const auto pixels = [](cv::Size size) {
    return static_cast<std::size_t>(std::max(0, size.area()));
  };
  const std::size_t buffer = picture == channel ? 0 : sizeof(float);
  const std::size_t odometry = (kPictureBytesPerPixel + buffer) * pixels(picture) + kPathBytes;
  return kChannelBytesPerPixel * pixels(channel) + num_sequences * odometry;
}

Blocks cut_into_blocks(std::span<const Flight> flights,
                       std::size_t num_filters,
                       std::size_t most_bytes) {
  if (num_filters > 0) {
    return cut_by_number(flights.size(), num_filters);
  }
  Blocks blocks;
  std::size_t block_bytes = 0;
  for (std::size_t begin = 0, end = 0; begin < flights.size(); begin = end) {
    std::size_t bytes = 0;
    for (; end < flights.size() && flights[end].layer == flights[begin].layer; ++end) {
      bytes += flights[end].bytes;
    }
    const bool goes_on = !blocks.empty() && block_bytes + bytes <= most_bytes &&
                         flights[blocks.back().back()].pass == flights[begin].pass;
    if (goes_on) {
      const auto more = indices(begin, end);
      blocks.back().insert(blocks.back().end(), more.begin(), more.end());
      block_bytes += bytes;
    } else {
      const std::size_t num_parts = (bytes + most_bytes - 1) / std::max<std::size_t>(most_bytes, 1);
      cut_evenly(begin, end, std::clamp<std::size_t>(num_parts, 1, end - begin), blocks);
      block_bytes = num_parts > 1 ? most_bytes : bytes;  // a part is a block of its own
    }
  }
  return blocks;
}

}  // namespace stemvo::search
