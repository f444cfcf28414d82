// SPDX-License-Identifier: MIT
#include "features/patch_alignment.hpp"

#include <algorithm>
#include <cmath>

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
/// Squares of a coarse patch and of its gradient: less is rounding.
constexpr float kLeastNormSq = 1e-3F;
constexpr float kLeastHessian = 1e-3F;

/// So far outside, a coarse patch and the samples of its gradient are inside the border.
constexpr float kReadable_px = 12.0F;

bool is_in_image(const BorderedImage& image, float x, float y, float outside_px = 0.0F) {
  return x >= -outside_px && y >= -outside_px &&
         x <= static_cast<float>(image.width - 1) + outside_px &&
         y <= static_cast<float>(image.height - 1) + outside_px;
}

constexpr int kNumValues = kPatchSide * kPatchSide;
constexpr float kHalf = 0.5F * (kPatchSide - 1);
using PatchVector = Eigen::Map<Eigen::Matrix<float, kNumValues, 1>>;
using PatchArray = Eigen::Map<Eigen::Array<float, kPatchSide, kPatchSide, Eigen::RowMajor>>;

/// The values, mean 0, and as first two columns their central differences.
void differentiate(const ValuesAround& around, Patch::Level& level, auto& columns) {
  using Around = Eigen::Array<float, kSideAround, kSideAround, Eigen::RowMajor>;
  const Eigen::Map<const Around> all(around.data());
  const auto part = [&](int row, int col) { return all.block<kPatchSide, kPatchSide>(row, col); };
  PatchArray value(level.value.data());
  value = part(1, 1) - part(1, 1).mean();
  level.norm_sq = value.square().sum();
  PatchArray{columns.col(0).data()} = 0.5F * (part(1, 2) - part(1, 0));
  PatchArray{columns.col(1).data()} = 0.5F * (part(2, 1) - part(0, 1));
}

void project_out_gain_and_bias(Patch::Level& level, auto& columns) {
  const PatchVector value(level.value.data());
  columns.rowwise() -= columns.colwise().mean();
  const auto share =
      (value.transpose().lazyProduct(columns) / std::max(level.norm_sq, kLeastNormSq)).eval();
  columns -= value.lazyProduct(share);
}

void set(const auto& columns, PatchColumns& step) {
  for (int k = 0; k < columns.cols(); ++k) {
    PatchVector(step[static_cast<std::size_t>(k)].data()) = columns.col(k);
  }
}

void cut_coarse(const BorderedImage& image, float x, float y, Patch::Level& level) {
  ValuesAround around;
  patch_kernels().sample_coarse_around(image, x - kHalf, y - kHalf, around);
  Eigen::Matrix<float, kNumValues, 2> columns;
  differentiate(around, level, columns);
  project_out_gain_and_bias(level, columns);
  const Eigen::Matrix2f hessian = columns.transpose().lazyProduct(columns);
  const bool has_inverse = hessian.diagonal().minCoeff() > kLeastHessian &&
                           hessian.determinant() > kMinDeterminant * hessian.diagonal().prod();
  set(columns.lazyProduct(has_inverse ? hessian.inverse().eval() : Eigen::Matrix2f::Zero().eval()),
      level.translation_step);
}

bool cut_fine(const BorderedImage& image, float x, float y, Patch& patch) {
  ValuesAround around;
  patch_kernels().sample_fine_around(image, x, y, around);
  Eigen::Matrix<float, kNumValues, 4> columns;
  Patch::Level& level = patch.levels.front();
  differentiate(around, level, columns);
  if (!(level.norm_sq > kMinNormSq)) {
    return false;
  }
  for (int i = 0; i < kNumValues; ++i) {
    const int row = i / kPatchSide;
    const float dx = static_cast<float>(i % kPatchSide) - kHalf;
    const float dy = static_cast<float>(row) - kHalf;
    columns(i, 2) = columns(i, 0) * dx + columns(i, 1) * dy;
    columns(i, 3) = columns(i, 1) * dx - columns(i, 0) * dy;
  }
  project_out_gain_and_bias(level, columns);
  const Eigen::Matrix4f hessian = columns.transpose() * columns;
  const Eigen::LDLT<Eigen::Matrix4f> solver(hessian);
  if (solver.info() != Eigen::Success || !(solver.rcond() > kMinCondition)) {
    return false;
  }
  set(columns.lazyProduct(solver.solve(Eigen::Matrix4f::Identity()).eval()), patch.step);
  set(columns.leftCols<2>().lazyProduct(hessian.topLeftCorner<2, 2>().inverse().eval()),
      level.translation_step);
  return true;
}

/// False: it left the image.
bool align_coarse(const Patch::Level& patch, const BorderedImage& image, float& x, float& y) {
  const PatchKernels& kernels = patch_kernels();
  for (int i = 0; i < kCoarseIterations; ++i) {
    if (!is_in_image(image, x, y, kReadable_px)) {
      return false;
    }
    PatchValues values;
    kernels.sample_coarse(image, x - kHalf, y - kHalf, values);
    float sums[7];
    kernels.sums(values, patch.translation_step, patch.value, sums);
    // More contrast than the patch's would lead too far; less only takes more steps.
    const float gain = std::max(sums[6] / std::max(patch.norm_sq, kLeastNormSq), 1.0F);
    const float dx = sums[0] / gain;
    const float dy = sums[1] / gain;
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
  const Patch::Level& level = patch.levels.front();
  PatchMatch result{start, 0.0F};
  bool only_translates = true;
  for (int i = 0; i < kFineIterations; ++i) {
    if (!is_plausible(result.warp, image, start)) {
      return {result.warp, 0.0F};
    }
    PatchValues values;
    kernels.sample_fine(image, result.warp, values);
    float sums[7];
    kernels.sums(values, only_translates ? level.translation_step : patch.step, level.value, sums);
    const float variance = sums[5] - sums[4] * sums[4] / kNumValues;
    const float gain = sums[6] / level.norm_sq;
    if (!(variance > 0.0F && gain > kMinGain)) {
      return {result.warp, 0.0F};
    }
    result.correlation = sums[6] / std::sqrt(variance * level.norm_sq);
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
float coarse_correlation(const Patch::Level& patch, const BorderedImage& image, float x, float y) {
  PatchValues values;
  patch_kernels().sample_coarse(image, x - kHalf, y - kHalf, values);
  const PatchVector sample(values.data());
  const float variances = patch.norm_sq * (sample.array() - sample.mean()).square().sum();
  const Eigen::Map<const PatchVector::PlainObject> value(patch.value.data());
  return variances > 0.0F ? sample.dot(value) / std::sqrt(variances) : 0.0F;
}

}  // namespace

bool cut_patch(Pyramid pyramid, float x, float y, Patch& patch) {
  if (!is_in_image(pyramid.front(), x, y) || !cut_fine(pyramid.front(), x, y, patch)) {
    return false;
  }
  float scale = 1.0F;
  for (std::size_t level = 1; level < pyramid.size() && level <= Patch::kNumCoarse; ++level) {
    scale *= 0.5F;
    cut_coarse(pyramid[level], scale * x, scale * y, patch.levels[level]);
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
    if (!align_coarse(patch.levels[index], pyramid[index], x, y)) {
      return {warp, 0.0F};
    }
    warp.x = x / scale;
    warp.y = y / scale;
  }
  const PatchMatch found = align_fine(patch, pyramid.front(), warp);
  const bool is_alone = pyramid.size() < 2 || found.correlation <= 0.0F;
  const bool is_there =
      is_alone || coarse_correlation(patch.levels[1], pyramid[1], 0.5F * found.warp.x,
                                     0.5F * found.warp.y) >= kMinCoarseCorrelation;
  return is_there ? found : PatchMatch{found.warp, 0.0F};
}

}  // namespace stemvo
