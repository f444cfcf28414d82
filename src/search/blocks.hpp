// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <opencv2/core/types.hpp>

namespace stemvo::search {

/// What the filters in flight may take by the estimate below; the process takes some 0.2 GB more,
/// and the weights and layers of the network.
inline constexpr std::size_t kBlockBytes = std::size_t{1} << 30;

/// Bytes of a filter in flight: its channel of this frame and of the next (floats), and, once per
/// sequence, its odometry: the picture (8 bits) with its pyramid and derivatives, where the channel
/// is brought to another size a buffer of floats, and the path. 256 filters of 620x188 take 1.7 to
/// 2.1 MB each (1 and 2 threads), by this 2.0.
[[nodiscard]] std::size_t bytes_in_flight(cv::Size channel,
                                          cv::Size picture,
                                          std::size_t num_sequences);

/// A filter to run.
struct Flight {
  std::size_t layer = 0;
  std::size_t pass = 0;  ///< layers with the same one come from one pass over a frame
  std::size_t bytes = 0;
};

/// Cuts filters, in the order they are in, into blocks that run in lock-step, so that as few passes
/// as possible are made: a block is a layer, or several of one pass, as far as `most_bytes` allows;
/// a layer that is larger is cut into equal parts. With `num_filters` > 0 each block has so many
/// instead. Indices into `flights`, each once.
[[nodiscard]] std::vector<std::vector<std::size_t>> cut_into_blocks(
    std::span<const Flight> flights, std::size_t num_filters, std::size_t most_bytes = kBlockBytes);

}  // namespace stemvo::search
