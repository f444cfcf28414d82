// SPDX-License-Identifier: MIT
#include <bit>
#include <cmath>
#include <cstring>

#include "features/patch_alignment.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "instruction_set.hpp"

namespace stemvo {
namespace {

/// Eight samples side by side: one AVX register, two of SSE or NEON. GCC and Clang know it without
/// intrinsics, and make worse code of plain loops.
using Float8 = float __attribute__((vector_size(32)));
constexpr int kLanes = 8;
static_assert(kPatchSide == kLanes);

/// Eight bytes, widened by interleaving them with zeros: twice, to 32 bits.
STEMVO_INLINE void load(const std::uint8_t* from, Float8& values) {
  static_assert(std::endian::native == std::endian::little);
  using Byte16 = std::uint8_t __attribute__((vector_size(16)));
  using Short8 = std::uint16_t __attribute__((vector_size(16)));
  using Int4 = std::int32_t __attribute__((vector_size(16)));
  using Float4 = float __attribute__((vector_size(16)));
  Byte16 bytes{};
  std::memcpy(&bytes, from, kLanes);
  const auto shorts = reinterpret_cast<Short8>(__builtin_shufflevector(
      bytes, Byte16{}, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23));
  const auto low =
      reinterpret_cast<Int4>(__builtin_shufflevector(shorts, Short8{}, 0, 8, 1, 9, 2, 10, 3, 11));
  const auto high =
      reinterpret_cast<Int4>(__builtin_shufflevector(shorts, Short8{}, 4, 12, 5, 13, 6, 14, 7, 15));
  values = __builtin_shufflevector(__builtin_convertvector(low, Float4),
                                   __builtin_convertvector(high, Float4), 0, 1, 2, 3, 4, 5, 6, 7);
}
STEMVO_INLINE void load(const float* from, Float8& values) {
  std::memcpy(&values, from, sizeof(values));
}
STEMVO_INLINE void store(const Float8& values, float* to) {
  std::memcpy(to, &values, sizeof(values));
}
STEMVO_INLINE float sum(const Float8& v) {
  return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}

struct Bilinear {
  const std::uint8_t* top_left;
  std::ptrdiff_t stride;
  float w00, w01, w10, w11;
};

STEMVO_INLINE Bilinear bilinear(const BorderedImage& image, float x, float y) {
  const float column = std::floor(x);
  const float row = std::floor(y);
  const float u = x - column;
  const float v = y - row;
  return {image.origin + static_cast<std::ptrdiff_t>(row) * image.stride +
              static_cast<std::ptrdiff_t>(column),
          image.stride,
          (1.0F - u) * (1.0F - v),
          u * (1.0F - v),
          (1.0F - u) * v,
          u * v};
}

STEMVO_INLINE void sample_row(const Bilinear& at, int row, Float8& values) {
  const std::uint8_t* top = at.top_left + row * at.stride;
  Float8 p00;
  Float8 p01;
  Float8 p10;
  Float8 p11;
  load(top, p00);
  load(top + 1, p01);
  load(top + at.stride, p10);
  load(top + at.stride + 1, p11);
  values = at.w00 * p00 + at.w01 * p01 + at.w10 * p10 + at.w11 * p11;
}

STEMVO_INLINE void sample_coarse(const BorderedImage& image,
                                 float x,
                                 float y,
                                 PatchValues& values) {
  const Bilinear at = bilinear(image, x, y);
  for (int j = 0; j < kPatchSide; ++j) {
    Float8 row;
    sample_row(at, j, row);
    store(row, values.data() + j * kLanes);
  }
}

STEMVO_INLINE void sample_coarse_around(const BorderedImage& image,
                                        float x,
                                        float y,
                                        ValuesAround& values) {
  const Bilinear at = bilinear(image, x - 1.0F, y - 1.0F);
  for (int j = 0; j < kSideAround; ++j) {
    for (const int i : {0, kSideAround - kLanes}) {
      Float8 row;
      sample_row({at.top_left + i, at.stride, at.w00, at.w01, at.w10, at.w11}, j, row);
      store(row, values.data() + j * kSideAround + i);
    }
  }
}

STEMVO_INLINE void cubic_spline(float t, float* w) {
  const float s = 1.0F - t;
  w[0] = s * s * s / 6.0F;
  w[3] = t * t * t / 6.0F;
  w[1] = 2.0F / 3.0F + t * t * (0.5F * t - 1.0F);
  w[2] = 1.0F - w[0] - w[1] - w[3];
}

STEMVO_INLINE void sums_of(const PatchValues& values,
                           const PatchColumns& columns,
                           const PatchValues& value,
                           float* sums) {
  Float8 by_column[4] = {};
  Float8 of_samples{};
  Float8 of_squares{};
  Float8 by_value{};
  for (int j = 0; j < kPatchSide; ++j) {
    Float8 sample;
    Float8 other;
    load(values.data() + j * kLanes, sample);
    for (std::size_t k = 0; k < 4; ++k) {
      load(columns[k].data() + j * kLanes, other);
      by_column[k] += other * sample;
    }
    of_samples += sample;
    of_squares += sample * sample;
    load(value.data() + j * kLanes, other);
    by_value += other * sample;
  }
  for (std::size_t k = 0; k < 4; ++k) {
    sums[k] = sum(by_column[k]);
  }
  sums[4] = sum(of_samples);
  sums[5] = sum(of_squares);
  sums[6] = sum(by_value);
}

/// Neither turned nor scaled: one set of weights for all samples, rows first. Eight columns of
/// `num_rows` rows from (x, y) on, to every `width`-th of the values.
template <int num_rows>
STEMVO_INLINE void sample_fine_upright(
    const BorderedImage& image, float x, float y, float* values, int width) {
  constexpr int kTaps = 4;
  const float column = std::floor(x);
  const float row = std::floor(y);
  float wx[kTaps];
  float wy[kTaps];
  cubic_spline(x - column, wx);
  cubic_spline(y - row, wy);
  const std::uint8_t* pixel = image.origin + (static_cast<std::ptrdiff_t>(row) - 1) * image.stride +
                              static_cast<std::ptrdiff_t>(column) - 1;
  Float8 rows[num_rows + kTaps - 1];
  for (Float8& in_row : rows) {
    Float8 taps[kTaps];
    for (int i = 0; i < kTaps; ++i) {
      load(pixel + i, taps[i]);
    }
    in_row = wx[0] * taps[0] + wx[1] * taps[1] + wx[2] * taps[2] + wx[3] * taps[3];
    pixel += image.stride;
  }
  for (int j = 0; j < num_rows; ++j) {
    const Float8 samples =
        wy[0] * rows[j] + wy[1] * rows[j + 1] + wy[2] * rows[j + 2] + wy[3] * rows[j + 3];
    store(samples, values + j * width);
  }
}

constexpr float kHalfFine = 0.5F * (kPatchSide - 1);

STEMVO_INLINE void sample_fine_upright(const BorderedImage& image,
                                       float center_x,
                                       float center_y,
                                       PatchValues& values) {
  sample_fine_upright<kPatchSide>(image, center_x - kHalfFine, center_y - kHalfFine, values.data(),
                                  kPatchSide);
}

STEMVO_INLINE void sample_fine_around(const BorderedImage& image,
                                      float center_x,
                                      float center_y,
                                      ValuesAround& values) {
  for (const int i : {0, kSideAround - kLanes}) {
    sample_fine_upright<kSideAround>(image, center_x - kHalfFine - 1.0F + static_cast<float>(i),
                                     center_y - kHalfFine - 1.0F, values.data() + i, kSideAround);
  }
}

STEMVO_INLINE bool is_upright(const Similarity& warp) { return warp.a == 1.0F && warp.b == 0.0F; }

void sample_fine_portable(const BorderedImage& image, const Similarity& warp, PatchValues& values) {
  if (is_upright(warp)) {
    sample_fine_upright(image, warp.x, warp.y, values);
    return;
  }
  for (int j = 0; j < kPatchSide; ++j) {
    for (int i = 0; i < kPatchSide; ++i) {
      const float dx = static_cast<float>(i) - kHalfFine;
      const float dy = static_cast<float>(j) - kHalfFine;
      const float x = warp.x + warp.a * dx - warp.b * dy;
      const float y = warp.y + warp.b * dx + warp.a * dy;
      const float column = std::floor(x);
      const float row = std::floor(y);
      float wx[4];
      float wy[4];
      cubic_spline(x - column, wx);
      cubic_spline(y - row, wy);
      const std::uint8_t* pixel = image.origin +
                                  (static_cast<std::ptrdiff_t>(row) - 1) * image.stride +
                                  static_cast<std::ptrdiff_t>(column) - 1;
      float sum = 0.0F;
      for (float w : wy) {
        sum += w * (wx[0] * static_cast<float>(pixel[0]) + wx[1] * static_cast<float>(pixel[1]) +
                    wx[2] * static_cast<float>(pixel[2]) + wx[3] * static_cast<float>(pixel[3]));
        pixel += image.stride;
      }
      values[static_cast<std::size_t>(j * kPatchSide + i)] = sum;
    }
  }
}

constexpr PatchKernels kPortable{portable_copy<sample_coarse>, portable_copy<sample_coarse_around>,
                                 sample_fine_portable, portable_copy<sample_fine_around>,
                                 portable_copy<sums_of>};

#if defined(__x86_64__)
STEMVO_AVX2 STEMVO_INLINE void cubic_spline(__m256 t, __m256* w) {
  const __m256 sixth = _mm256_set1_ps(1.0F / 6.0F);
  const __m256 one = _mm256_set1_ps(1.0F);
  const __m256 t_sq = _mm256_mul_ps(t, t);
  const __m256 s = _mm256_sub_ps(one, t);
  w[0] = _mm256_mul_ps(_mm256_mul_ps(s, s), _mm256_mul_ps(s, sixth));
  w[3] = _mm256_mul_ps(t_sq, _mm256_mul_ps(t, sixth));
  w[1] = _mm256_fmadd_ps(t_sq, _mm256_fmsub_ps(_mm256_set1_ps(0.5F), t, one),
                         _mm256_set1_ps(2.0F / 3.0F));
  w[2] = _mm256_sub_ps(_mm256_sub_ps(one, w[0]), _mm256_add_ps(w[1], w[3]));
}

/// Eight samples at once: a gather of four bytes holds the taps of one row.
STEMVO_AVX2 void sample_fine_avx2(const BorderedImage& image,
                                  const Similarity& warp,
                                  PatchValues& values) {
  if (is_upright(warp)) {
    sample_fine_upright(image, warp.x, warp.y, values);
    return;
  }
  const __m256 dx = _mm256_setr_ps(-3.5F, -2.5F, -1.5F, -0.5F, 0.5F, 1.5F, 2.5F, 3.5F);
  const __m256 ax = _mm256_fmadd_ps(_mm256_set1_ps(warp.a), dx, _mm256_set1_ps(warp.x));
  const __m256 bx = _mm256_fmadd_ps(_mm256_set1_ps(warp.b), dx, _mm256_set1_ps(warp.y));
  const __m256i stride = _mm256_set1_epi32(static_cast<int>(image.stride));
  const __m256i low = _mm256_set1_epi32(255);
  for (int j = 0; j < kPatchSide; ++j) {
    const float dy = static_cast<float>(j) - kHalfFine;
    const __m256 x = _mm256_sub_ps(ax, _mm256_set1_ps(warp.b * dy));
    const __m256 y = _mm256_add_ps(bx, _mm256_set1_ps(warp.a * dy));
    const __m256 column = _mm256_floor_ps(x);
    const __m256 row = _mm256_floor_ps(y);
    __m256 wx[4];
    __m256 wy[4];
    cubic_spline(_mm256_sub_ps(x, column), wx);
    cubic_spline(_mm256_sub_ps(y, row), wy);
    __m256i offset = _mm256_add_epi32(_mm256_mullo_epi32(_mm256_cvtps_epi32(row), stride),
                                      _mm256_cvtps_epi32(column));
    const auto* pixels = reinterpret_cast<const int*>(image.origin - image.stride - 1);
    __m256 sum = _mm256_setzero_ps();
    for (const __m256 w : wy) {
      const __m256i taps = _mm256_i32gather_epi32(pixels, offset, 1);
      const __m256 p0 = _mm256_cvtepi32_ps(_mm256_and_si256(taps, low));
      const __m256 p1 = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(taps, 8), low));
      const __m256 p2 = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(taps, 16), low));
      const __m256 p3 = _mm256_cvtepi32_ps(_mm256_srli_epi32(taps, 24));
      const __m256 in_row = _mm256_fmadd_ps(
          wx[0], p0,
          _mm256_fmadd_ps(wx[1], p1, _mm256_fmadd_ps(wx[2], p2, _mm256_mul_ps(wx[3], p3))));
      sum = _mm256_fmadd_ps(w, in_row, sum);
      offset = _mm256_add_epi32(offset, stride);
    }
    _mm256_storeu_ps(values.data() + j * kPatchSide, sum);
  }
}

constexpr PatchKernels kAvx2{avx2_copy<sample_coarse>, avx2_copy<sample_coarse_around>,
                             sample_fine_avx2, avx2_copy<sample_fine_around>, avx2_copy<sums_of>};
#endif

}  // namespace

const PatchKernels& patch_kernels() {
#if defined(__x86_64__)
  return uses_avx2() ? kAvx2 : kPortable;
#else
  return kPortable;
#endif
}

}  // namespace stemvo
