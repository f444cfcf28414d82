// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <span>

#include "features/patch_kernels.hpp"

namespace stemvo {

/// A corner's appearance when it was cut out, with what inverse-compositional alignment needs of it
/// (Baker and Matthews, Lucas-Kanade 20 years on, 2004).
struct Patch {
  static constexpr int kNumCoarse = 4;
  struct Coarse : CoarsePatch {            ///< 8x8, moved by a translation
    std::array<float, 3> inverse_hessian;  ///< xx, xy, yy; all 0 where it has no inverse
  };
  std::array<Coarse, kNumCoarse> coarse;  ///< of levels 1, 2, ..
  FineValues value;                       ///< 8x8 of level 0, mean 0
  /// Rows of the inverse Hessian times the steepest-descent images (x, y, scale, rotation) made
  /// orthogonal to {1, value}: bias and gain drop out.
  FineColumns step;
  FineColumns translation_step;  ///< of a translation alone; the last two are 0
  float norm_sq = 0.0F;          ///< of value
};

/// Pyramid: level k + 1 has half the size of level k, pixel (x, y) of it lies at (2x, 2y).
using Pyramid = std::span<const BorderedImage>;
/// Alignment reads the images of a pyramid so far beyond their borders.
inline constexpr int kPatchBorder_px = 24;

/// False: too little texture to be aligned.
[[nodiscard]] bool cut_patch(Pyramid pyramid, float x, float y, Patch& patch);

struct PatchMatch {
  Similarity warp;           ///< pixels of level 0, from the patch's own
  float correlation = 0.0F;  ///< 0: left the image, or did not converge
};

/// Aligns from `start`, at levels `first_level` down to 0.
[[nodiscard]] PatchMatch align_patch(const Patch& patch,
                                     Pyramid pyramid,
                                     const Similarity& start,
                                     int first_level);

}  // namespace stemvo
