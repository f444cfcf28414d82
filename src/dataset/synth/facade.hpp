// SPDX-License-Identifier: MIT
#pragma once

#include "dataset/synth/materials.hpp"

namespace stemvo::synth {

/// A front with a plinth, rows of windows and one door; u in [0, size[0]], v up from the ground.
[[nodiscard]] Rgb facade(const Style& style, const Footprint& at, const Textures& textures);

/// The same wall without openings.
[[nodiscard]] Rgb plaster(const Style& style, const Footprint& at, const Textures& textures);

}  // namespace stemvo::synth
