// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "features/patch_alignment.hpp"
#include "features/patch_kernels.hpp"

namespace stemvo {
namespace {

constexpr double kCatmullRom = -0.5;  ///< its free parameter in Keys's cubic convolution (1981)

/// Gray value of a sum of waves, which can be asked for anywhere; 128 +- 100.
double texture(double x, double y) {
  double sum = 0.0;
  for (int i = 1; i <= 12; ++i) {
    const double length = 5.0 + 1.5 * i;
    const double angle = 2.4 * i;
    sum += std::sin((std::cos(angle) * x + std::sin(angle) * y) * 6.28 / length + i);
  }
  return 128.0 + 100.0 * std::clamp(sum / 7.0, -1.0, 1.0);
}

/// Levels of half the size, as a front end makes them.
struct TestPyramid {
  explicit TestPyramid(cv::Mat level) {
    for (int i = 0; i < 3; ++i) {
      cv::Mat bordered;
      const int border = kPatchBorder_px;
      cv::copyMakeBorder(level, bordered, border, border, border, border, cv::BORDER_REFLECT_101);
      mats.push_back(bordered);
      levels.push_back({bordered.ptr(border) + border, static_cast<std::ptrdiff_t>(bordered.step),
                        level.cols, level.rows});
      cv::Mat half;
      cv::pyrDown(level, half);
      level = half;
    }
  }
  std::vector<cv::Mat> mats;
  std::vector<BorderedImage> levels;
};

constexpr int kWidth = 320;
constexpr int kHeight = 240;

/// The texture seen through a similarity about the image's centre: pixel p shows the texture at the
/// inverse of q = t + [a -b; b a] p. With gain, bias, noise and blur.
struct View {
  Similarity warp;
  double gain = 1.0;
  double bias = 0.0;
  double noise = 0.0;
  double blur_px = 0.0;

  [[nodiscard]] cv::Mat render() const {
    cv::Mat values(kHeight, kWidth, CV_64F);
    const double scale_sq = warp.a * warp.a + warp.b * warp.b;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double dx = x - static_cast<double>(warp.x);
        const double dy = y - static_cast<double>(warp.y);
        values.at<double>(y, x) = bias + gain * texture((warp.a * dx + warp.b * dy) / scale_sq,
                                                        (-warp.b * dx + warp.a * dy) / scale_sq);
      }
    }
    if (blur_px > 0.0) {
      cv::GaussianBlur(values, values, {}, blur_px);
    }
    cv::Mat random(values.size(), CV_64F);
    cv::RNG generator(3);
    generator.fill(random, cv::RNG::NORMAL, 0.0, noise);
    cv::Mat pixels;
    cv::Mat(values + random).convertTo(pixels, CV_8U);
    return pixels;
  }
};

/// Errors (px) of patches all over the image, from starts that are `off_px` wrong; a patch that is
/// not found counts as 10 px.
std::vector<double> errors_px(const View& view, float off_px) {
  const TestPyramid before(View().render());
  const TestPyramid after(view.render());
  std::vector<double> errors;
  for (float y = 40.0F; y < kHeight - 40.0F; y += 16.0F) {
    for (float x = 40.0F; x < kWidth - 40.0F; x += 16.0F) {
      Patch patch;
      if (!cut_patch(before.levels, x, y, patch)) {
        continue;
      }
      const Similarity& w = view.warp;
      const float true_x = w.x + w.a * x - w.b * y;
      const float true_y = w.y + w.b * x + w.a * y;
      const PatchMatch found =
          align_patch(patch, after.levels, {true_x + off_px, true_y - off_px, 1.0F, 0.0F}, 1);
      errors.push_back(found.correlation < 0.7F
                           ? 10.0
                           : std::hypot(found.warp.x - true_x, found.warp.y - true_y));
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

double quantile(const std::vector<double>& sorted, double share) {
  return sorted.at(static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1)));
}

TEST(PatchAlignment, PlantedWarpsAreFoundToAFiftiethOfAPixel) {
  for (const Similarity& warp : {Similarity{0.0F, 0.0F, 1.0F, 0.0F},
                                 {3.37F, -2.81F, 1.0F, 0.0F},
                                 {-8.0F, 5.5F, 1.06F, 0.0F},
                                 {4.2F, -6.0F, 0.99F, 0.03F}}) {
    const std::vector<double> errors = errors_px({warp}, 1.5F);
    EXPECT_GT(errors.size(), 100U);
    EXPECT_LE(quantile(errors, 0.5), 0.02) << warp.x << ' ' << warp.a << ' ' << warp.b;
    EXPECT_LE(quantile(errors, 0.9), 0.06) << warp.x << ' ' << warp.a << ' ' << warp.b;
  }
}

TEST(PatchAlignment, GainAndBiasChangeNothing) {
  const std::vector<double> errors = errors_px({{3.37F, -2.81F, 1.0F, 0.0F}, 0.7, 20.0}, 0.5F);
  EXPECT_LE(quantile(errors, 0.5), 0.02);
}

/// Medians, pixels, over noise (gray values), blur (px, of the second image only) and scale.
TEST(PatchAlignment, ErrorsOverNoiseBlurAndScale) {
  struct Case {
    double noise;
    double blur_px;
    float scale;
    double bound_px;
  };
  for (const Case& c : {Case{2.0, 0.0, 1.0F, 0.04},
                        {5.0, 0.0, 1.0F, 0.1},
                        {10.0, 0.0, 1.0F, 0.2},
                        {0.0, 0.5, 1.0F, 0.06},
                        {0.0, 1.0, 1.0F, 0.2},
                        {0.0, 0.0, 1.2F, 0.03},
                        {0.0, 0.0, 0.85F, 0.03},
                        {2.0, 1.0, 1.1F, 0.2}}) {
    const View view{{1.3F, -0.4F, c.scale, 0.0F}, 1.0, 0.0, c.noise, c.blur_px};
    EXPECT_LE(quantile(errors_px(view, 0.5F), 0.5), c.bound_px)
        << "noise " << c.noise << ", blur " << c.blur_px << ", scale " << c.scale;
  }
}

TEST(PatchAlignment, WhatIsNotThereIsNotFound) {
  const TestPyramid before(View().render());
  cv::Mat other(kHeight, kWidth, CV_8U);
  cv::RNG(9).fill(other, cv::RNG::UNIFORM, 0, 256);
  const TestPyramid after(other);
  int found = 0;
  for (float x = 40.0F; x < 280.0F; x += 8.0F) {
    Patch patch;
    ASSERT_TRUE(cut_patch(before.levels, x, 120.0F, patch));
    found += align_patch(patch, after.levels, {x, 120.0F}, 2).correlation > 0.7F ? 1 : 0;
  }
  EXPECT_LE(found, 3);
}

TEST(PatchAlignment, APlainSurfaceIsNotCut) {
  const TestPyramid plain(cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(90)));
  Patch patch;
  EXPECT_FALSE(cut_patch(plain.levels, 100.0F, 100.0F, patch));
}

/// Keys's cubic convolution in double precision.
double cubic_weight(double distance) {
  const double t = std::abs(distance);
  if (t < 1.0) {
    return (kCatmullRom + 2.0) * t * t * t - (kCatmullRom + 3.0) * t * t + 1.0;
  }
  return t < 2.0 ? kCatmullRom * (t * t * t - 5.0 * t * t + 8.0 * t - 4.0) : 0.0;
}

double cubic_sample(const BorderedImage& image, double x, double y) {
  double sum = 0.0;
  const auto column = static_cast<int>(std::floor(x));
  const auto row = static_cast<int>(std::floor(y));
  for (int j = row - 1; j <= row + 2; ++j) {
    for (int i = column - 1; i <= column + 2; ++i) {
      sum += cubic_weight(x - i) * cubic_weight(y - j) * image.origin[j * image.stride + i];
    }
  }
  return sum;
}

/// The portable loops, and those of this processor, against plain code in double precision.
TEST(PatchKernels, EveryInstructionSetGivesThePlainValues) {
  const TestPyramid pyramid(View().render());
  const BorderedImage& image = pyramid.levels.front();
  for (const PatchKernels* kernels : {&portable_patch_kernels(), &patch_kernels()}) {
    for (const Similarity& warp : {Similarity{60.3F, 70.8F, 1.1F, 0.2F},
                                   {0.0F, 0.0F, 1.0F, 0.0F},
                                   {60.3F, 70.9F, 1.0F, 0.0F},
                                   {319.0F, 239.0F, 0.8F, -0.3F}}) {
      FineValues values;
      kernels->sample_fine(image, warp, values);
      for (int k = 0; k < kFineSide * kFineSide; ++k) {
        const double dx = k % kFineSide - 3.5;
        const double dy = k / kFineSide - 3.5;
        EXPECT_NEAR(values[static_cast<std::size_t>(k)],
                    cubic_sample(image, warp.x + warp.a * dx - warp.b * dy,
                                 warp.y + warp.b * dx + warp.a * dy),
                    0.02);
      }
    }
    CoarseValues coarse;
    kernels->sample_coarse(image, 20.25F, 30.75F, coarse);
    EXPECT_NEAR(coarse[0],
                0.75 * (0.25 * image.origin[30 * image.stride + 20] +
                        0.75 * image.origin[31 * image.stride + 20]) +
                    0.25 * (0.25 * image.origin[30 * image.stride + 21] +
                            0.75 * image.origin[31 * image.stride + 21]),
                1e-3);
    float sums[2];
    CoarsePatch patch{{}, {}, coarse};
    patch.gx.fill(1.0F);
    kernels->coarse_sums(image, 20.25F, 30.75F, patch, sums);
    double sum = 0.0;
    double squares = 0.0;
    for (const float value : coarse) {
      sum += value;
      squares += static_cast<double>(value) * value;
    }
    EXPECT_NEAR(sums[0], sum, 1e-5 * sum);
    EXPECT_NEAR(sums[1], squares, 1e-5 * squares);
    FineColumns columns{};
    columns[2] = coarse;
    FineValues ramp;
    std::iota(ramp.begin(), ramp.end(), 0.0F);
    float fine[7];
    kernels->fine_sums(coarse, columns, ramp, fine);
    EXPECT_EQ(fine[0], 0.0F);
    EXPECT_NEAR(fine[2], squares, 1e-5 * squares);
    EXPECT_NEAR(fine[4], sum, 1e-5 * sum);
    EXPECT_NEAR(fine[5], squares, 1e-5 * squares);
    const double product = std::inner_product(coarse.begin(), coarse.end(), ramp.begin(), 0.0);
    EXPECT_NEAR(fine[6], product, 1e-5 * product);
  }
}

}  // namespace
}  // namespace stemvo
