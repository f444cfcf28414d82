// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

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

inline constexpr int kCoarseSide = 8;
inline constexpr int kFineSide = 8;
using CoarseValues = std::array<float, kCoarseSide * kCoarseSide>;
using FineValues = std::array<float, kFineSide * kFineSide>;
using FineColumns = std::array<FineValues, 4>;

/// Values and their gradient.
struct CoarsePatch {
  CoarseValues value;
  CoarseValues gx;
  CoarseValues gy;
};

/// The inner loops of alignment for one instruction set. The values of two sets
/// differ in their last digits.
struct PatchKernels {
  /// Bilinear samples at (x + i, y + j), i and j from 0 to 7.
  void (*sample_coarse)(const BorderedImage& image, float x, float y, CoarseValues& values);
  /// sums[0] = sum of gx e and sums[1] = of gy e, where e = sample - value, samples as above.
  void (*coarse_sums)(
      const BorderedImage& image, float x, float y, const CoarsePatch& patch, float* sums);
  /// Catmull-Rom samples at the similarity's images of (i - 3.5, j - 3.5), i and j from 0 to 7.
  void (*sample_fine)(const BorderedImage& image, const Similarity& warp, FineValues& values);
  /// sums[k] = sum of columns[k] samples; sums[4] of samples; [5] of samples^2; [6] of samples
  /// value.
  void (*fine_sums)(const FineValues& samples,
                    const FineColumns& columns,
                    const FineValues& value,
                    float* sums);
};

/// The set that this process uses.
[[nodiscard]] const PatchKernels& patch_kernels();

}  // namespace stemvo
