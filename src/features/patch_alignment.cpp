// SPDX-License-Identifier: MIT
#include "features/patch_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

namespace stemvo {
namespace {

constexpr int kCoarseIterations = 12;
constexpr float kCoarseConverged_px = 0.1F;
constexpr int kFineIterations = 12;
constexpr float kFineConverged_px = 0.03F;
/// A shorter step of the translation: scale and rotation are let go too.
constexpr float kTranslated_px = 0.1F;
/// Contrast less than this share of the patch's: it is something else.
constexpr float kMinGain = 0.1F;
/// The finest level may not leave what the coarser ones found by more.
constexpr float kMaxFineMove_px = 4.0F;
constexpr float kMaxWarpScale = 1.7F;
/// Minimum correlation of the surroundings, one level up: in another scene the best of a few pixels
/// often looks right.
constexpr float kMinCoarseCorrelation = 0.5F;
/// Minimum sum of squares of a patch about its mean, gray values: a plain one cannot be aligned.
constexpr float kMinNormSq = 64.0F * static_cast<float>(kSplineContrast * kSplineContrast);
/// Hessians worse conditioned than this have no inverse.
constexpr float kMinDeterminant = 1e-3F;
constexpr float kMinCondition = 1e-5F;

/// So far outside, a coarse patch and the samples of its gradient are inside the border.
constexpr float kReadable_px = 12.0F;

bool is_in_image(const BorderedImage& image, float x, float y, float outside_px = 0.0F) {
  return x >= -outside_px && y >= -outside_px &&
         x <= static_cast<float>(image.width - 1) + outside_px &&
         y <= static_cast<float>(image.height - 1) + outside_px;
}

using PatchVector = Eigen::Map<Eigen::Matrix<float, kFineSide * kFineSide, 1>>;
using PatchArray = Eigen::Map<Eigen::Array<float, kFineSide, kFineSide, Eigen::RowMajor>>;
static_assert(kCoarseSide == kFineSide);

/// Values and their central differences, each 8x8.
void differentiate(const ValuesAround& around, float* value, float* gx, float* gy) {
  using Around = Eigen::Array<float, kSideAround, kSideAround, Eigen::RowMajor>;
  const Eigen::Map<const Around> all(around.data());
  const auto part = [&](int row, int col) { return all.block<kFineSide, kFineSide>(row, col); };
  PatchArray{value} = part(1, 1);
  PatchArray{gx} = 0.5F * (part(1, 2) - part(1, 0));
  PatchArray{gy} = 0.5F * (part(2, 1) - part(0, 1));
}

void cut_coarse(const BorderedImage& image, float x, float y, Patch::Coarse& coarse) {
  constexpr float kHalf = 0.5F * (kCoarseSide - 1);
  ValuesAround around;
  patch_kernels().sample_coarse_around(image, x - kHalf, y - kHalf, around);
  differentiate(around, coarse.value.data(), coarse.gx.data(), coarse.gy.data());
  PatchVector value(coarse.value.data());
  PatchVector gx(coarse.gx.data());
  PatchVector gy(coarse.gy.data());
  value.array() -= value.mean();
  coarse.norm_sq = value.squaredNorm() + std::numeric_limits<float>::min();
  for (PatchVector& gradient : {std::ref(gx), std::ref(gy)}) {
    gradient.array() -= gradient.mean();
    gradient -= value * (value.dot(gradient) / coarse.norm_sq);
  }
  const float xx = gx.squaredNorm();
  const float xy = gx.dot(gy);
  const float yy = gy.squaredNorm();
  const float determinant = xx * yy - xy * xy;
  const float inverse =
      determinant > kMinDeterminant * xx * yy && determinant > 0.0F ? 1.0F / determinant : 0.0F;
  coarse.inverse_hessian = {yy * inverse, -xy * inverse, xx * inverse};
}

bool cut_fine(const BorderedImage& image, float x, float y, Patch& patch) {
  ValuesAround around;
  patch_kernels().sample_fine_around(image, x, y, around);
  Eigen::Matrix<float, kFineSide * kFineSide, 4> columns;
  differentiate(around, patch.value.data(), columns.col(0).data(), columns.col(1).data());
  PatchVector value(patch.value.data());
  value.array() -= value.mean();
  patch.norm_sq = value.squaredNorm();
  if (!(patch.norm_sq > kMinNormSq)) {
    return false;
  }
  for (int i = 0; i < kFineSide * kFineSide; ++i) {
    const int row = i / kFineSide;
    const float dx = static_cast<float>(i % kFineSide) - 0.5F * (kFineSide - 1);
    const float dy = static_cast<float>(row) - 0.5F * (kFineSide - 1);
    columns(i, 2) = columns(i, 0) * dx + columns(i, 1) * dy;
    columns(i, 3) = columns(i, 1) * dx - columns(i, 0) * dy;
  }
  columns.rowwise() -= columns.colwise().mean();
  columns -= value * (value.transpose() * columns) / patch.norm_sq;
  const Eigen::Matrix4f hessian = columns.transpose() * columns;
  const Eigen::LDLT<Eigen::Matrix4f> solver(hessian);
  if (solver.info() != Eigen::Success || !(solver.rcond() > kMinCondition)) {
    return false;
  }
  const Eigen::Matrix4f inverse = solver.solve(Eigen::Matrix4f::Identity());
  const Eigen::Matrix2f of_translation = hessian.topLeftCorner<2, 2>().inverse();
  for (int k = 0; k < 4; ++k) {
    const auto index = static_cast<std::size_t>(k);
    PatchVector(patch.step[index].data()) = columns * inverse.col(k);
    PatchVector translation(patch.translation_step[index].data());
    if (k < 2) {
      translation = columns.leftCols<2>() * of_translation.col(k);
    } else {
      translation.setZero();
    }
  }
  return true;
}

/// False: it left the image.
bool align_coarse(const Patch::Coarse& patch, const BorderedImage& image, float& x, float& y) {
  const PatchKernels& kernels = patch_kernels();
  constexpr float kHalf = 0.5F * (kCoarseSide - 1);
  const auto& inverse = patch.inverse_hessian;
  for (int i = 0; i < kCoarseIterations; ++i) {
    if (!is_in_image(image, x, y, kReadable_px)) {
      return false;
    }
    float sums[3];
    kernels.coarse_sums(image, x - kHalf, y - kHalf, patch, sums);
    // More contrast than the patch's would lead too far; less only takes more steps.
    const float gain = std::max(sums[2] / patch.norm_sq, 1.0F);
    const float dx = (inverse[0] * sums[0] + inverse[1] * sums[1]) / gain;
    const float dy = (inverse[1] * sums[0] + inverse[2] * sums[1]) / gain;
    x -= dx;
    y -= dy;
    if (dx * dx + dy * dy < kCoarseConverged_px * kCoarseConverged_px) {
      break;
    }
  }
  return is_in_image(image, x, y, kReadable_px);
}

/// W <- W o dW^-1; similarities are complex numbers. Returns the length of the step.
float compose(Similarity& warp, const float* step) {
  const float c = 1.0F + step[2];
  const float s = step[3];
  const float inverse = 1.0F / (c * c + s * s);
  const float a = (warp.a * c + warp.b * s) * inverse;
  const float b = (warp.b * c - warp.a * s) * inverse;
  const float dx = a * step[0] - b * step[1];
  const float dy = b * step[0] + a * step[1];
  warp = {warp.x - dx, warp.y - dy, a, b};
  return std::hypot(dx, dy);
}

/// Inside the image, near the start and of a like size.
bool is_plausible(const Similarity& warp, const BorderedImage& image, const Similarity& start) {
  const float scale_sq = warp.a * warp.a + warp.b * warp.b;
  return is_in_image(image, warp.x, warp.y) &&
         std::hypot(warp.x - start.x, warp.y - start.y) <= kMaxFineMove_px &&
         scale_sq < kMaxWarpScale * kMaxWarpScale &&
         scale_sq * kMaxWarpScale * kMaxWarpScale > 1.0F;
}

/// A translation first, until it has nearly converged; then the similarity.
PatchMatch align_fine(const Patch& patch, const BorderedImage& image, const Similarity& start) {
  const PatchKernels& kernels = patch_kernels();
  constexpr float kNumPixels = kFineSide * kFineSide;
  PatchMatch result{start, 0.0F};
  bool only_translates = true;
  for (int i = 0; i < kFineIterations; ++i) {
    if (!is_plausible(result.warp, image, start)) {
      return {result.warp, 0.0F};
    }
    FineValues values;
    kernels.sample_fine(image, result.warp, values);
    float sums[7];
    kernels.fine_sums(values, only_translates ? patch.translation_step : patch.step, patch.value,
                      sums);
    const float variance = sums[5] - sums[4] * sums[4] / kNumPixels;
    const float gain = sums[6] / patch.norm_sq;
    if (!(variance > 0.0F && gain > kMinGain)) {
      return {result.warp, 0.0F};
    }
    result.correlation = sums[6] / std::sqrt(variance * patch.norm_sq);
    // The patch's derivatives have its contrast; the image's are `gain` times as large.
    const float step[4] = {sums[0] / gain, sums[1] / gain, sums[2] / gain, sums[3] / gain};
    const float length = compose(result.warp, step);
    if (length < kFineConverged_px && !only_translates) {
      break;
    }
    only_translates = only_translates && length > kTranslated_px;
  }
  return is_plausible(result.warp, image, start) ? result : PatchMatch{result.warp, 0.0F};
}

/// Correlation of the surroundings, which the finest level does not see.
float coarse_correlation(const Patch::Coarse& patch, const BorderedImage& image, float x, float y) {
  constexpr float kHalf = 0.5F * (kCoarseSide - 1);
  constexpr float kNumPixels = kCoarseSide * kCoarseSide;
  CoarseValues values;
  patch_kernels().sample_coarse(image, x - kHalf, y - kHalf, values);
  float sum_a = 0.0F;
  float sum_b = 0.0F;
  float sum_aa = 0.0F;
  float sum_bb = 0.0F;
  float sum_ab = 0.0F;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float a = values[i];
    const float b = patch.value[i];
    sum_a += a;
    sum_b += b;
    sum_aa += a * a;
    sum_bb += b * b;
    sum_ab += a * b;
  }
  const float variances =
      (sum_aa - sum_a * sum_a / kNumPixels) * (sum_bb - sum_b * sum_b / kNumPixels);
  return variances > 0.0F ? (sum_ab - sum_a * sum_b / kNumPixels) / std::sqrt(variances) : 0.0F;
}

}  // namespace

bool cut_patch(Pyramid pyramid, float x, float y, Patch& patch) {
  if (!is_in_image(pyramid.front(), x, y) || !cut_fine(pyramid.front(), x, y, patch)) {
    return false;
  }
  float scale = 1.0F;
  for (std::size_t level = 1; level < pyramid.size() && level <= Patch::kNumCoarse; ++level) {
    scale *= 0.5F;
    cut_coarse(pyramid[level], scale * x, scale * y, patch.coarse[level - 1]);
  }
  return true;
}

PatchMatch align_patch(const Patch& patch,
                       Pyramid pyramid,
                       const Similarity& start,
                       int first_level) {
  Similarity warp = start;
  for (int level = std::min({first_level, static_cast<int>(pyramid.size()) - 1, Patch::kNumCoarse});
       level > 0; --level) {
    const float scale = 1.0F / static_cast<float>(1 << level);
    float x = scale * warp.x;
    float y = scale * warp.y;
    const auto index = static_cast<std::size_t>(level);
    if (!align_coarse(patch.coarse[index - 1], pyramid[index], x, y)) {
      return {warp, 0.0F};
    }
    warp.x = x / scale;
    warp.y = y / scale;
  }
  const PatchMatch found = align_fine(patch, pyramid.front(), warp);
  const bool is_alone = pyramid.size() < 2 || found.correlation <= 0.0F;
  const bool is_there =
      is_alone || coarse_correlation(patch.coarse[0], pyramid[1], 0.5F * found.warp.x,
                                     0.5F * found.warp.y) >= kMinCoarseCorrelation;
  return is_there ? found : PatchMatch{found.warp, 0.0F};
}

}  // namespace stemvo
