// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace stemvo {

/// An 8-bit image whose pixels may be read outside of it, up to a border's width.
struct BorderedImage {
  const std::uint8_t* origin = nullptr;  ///< pixel (0, 0)
  std::ptrdiff_t stride = 0;             ///< bytes from row to row
  int width = 0;
  int height = 0;
};

/// Similarity: q = t + [a -b; b a] x.
struct Similarity {
  float x = 0.0F;
  float y = 0.0F;
  float a = 1.0F;
  float b = 0.0F;
};

inline constexpr int kPatchSide = 8;
using PatchValues = std::array<float, kPatchSide * kPatchSide>;
using PatchColumns = std::array<PatchValues, 4>;
/// A patch and a margin of one sample, for derivatives.
inline constexpr int kSideAround = kPatchSide + 2;
using ValuesAround = std::array<float, kSideAround * kSideAround>;

/// The inner loops of alignment for one instruction set. The values of two sets
/// differ in their last digits.
struct PatchKernels {
  /// Bilinear samples at (x + i, y + j), i and j from 0 to 7.
  void (*sample_coarse)(const BorderedImage& image, float x, float y, PatchValues& values);
  /// i and j from -1 to 8.
  void (*sample_coarse_around)(const BorderedImage& image, float x, float y, ValuesAround& values);
  /// Cubic spline of the image's coefficients at the similarity's images of (i - 3.5, j - 3.5), i
  /// and j from 0 to 7.
  void (*sample_fine)(const BorderedImage& image, const Similarity& warp, PatchValues& values);
  /// Upright, i and j from -1 to 8.
  void (*sample_fine_around)(const BorderedImage& image, float x, float y, ValuesAround& values);
  /// sums[k] = sum of columns[k] samples; sums[4] of samples; [5] of samples^2; [6] of samples
  /// value.
  void (*sums)(const PatchValues& samples,
               const PatchColumns& columns,
               const PatchValues& value,
               float* sums);
};

/// The set that this process uses.
[[nodiscard]] const PatchKernels& patch_kernels();

/// A corner's appearance when it was cut out, with what inverse-compositional alignment needs of it
/// (Baker and Matthews, Lucas-Kanade 20 years on, 2004).
struct Patch {
  static constexpr int kNumCoarse = 4;
  /// Aligned, so that sums do not depend on where a patch lies.
  struct alignas(32) Level {
    PatchValues value;  ///< 8x8, mean 0
    /// Rows of the inverse Hessian of a translation times its steepest-descent images, made
    /// orthogonal to {1, value}: bias and gain drop out. The last two, or all where there is no
    /// inverse, are 0.
    PatchColumns translation_step{};
    float norm_sq = 0.0F;  ///< of value
  };
  std::array<Level, 1 + kNumCoarse> levels;
  PatchColumns step;  ///< of level 0, likewise of a similarity: x, y, scale, rotation
};

/// Pyramid: level k + 1 has half the size of level k, pixel (x, y) of it lies at (2x, 2y). Level 0
/// holds the coefficients of a cubic spline, at kSplineContrast.
using Pyramid = std::span<const BorderedImage>;
/// Alignment reads the images of a pyramid so far beyond their borders.
inline constexpr int kPatchBorder_px = 24;
/// The finest level has so much of the image's contrast.
inline constexpr double kSplineContrast = 0.7;

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
