// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "stemvo/dataset/sequence.hpp"

namespace stemvo::benchmark {

/// What is known of a sequence of the KITTI odometry benchmark (its pose and image files).
struct OfficialSequence {
  std::string_view name;
  std::size_t num_frames = 0;
  double length_m = 0.0;  ///< of the ground truth, rounded to a metre
  int width_px = 0;
  int height_px = 0;
};

/// 00 to 10, those with ground truth; nullopt for any other name.
[[nodiscard]] std::optional<OfficialSequence> find_official(std::string_view name);

/// All official frames, at their size, along the official path: a clip, a drive rendered at another
/// size, or other frames of the same name are not.
[[nodiscard]] bool is_official(const OfficialSequence& official, const KittiSequence& sequence);

}  // namespace stemvo::benchmark
