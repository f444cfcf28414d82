// SPDX-License-Identifier: MIT
#include <opencv2/video/tracking.hpp>

#include "features/patch_pyramid.hpp"
#include "instruction_set.hpp"
#include "stemvo/options.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

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

struct TestPyramid : PatchPyramid {
  explicit TestPyramid(const cv::Mat& pixels) : PatchPyramid({pixels, {}}, 3) {}
};

constexpr int kViewWidth = 320;
constexpr int kViewHeight = 240;

/// The texture seen through a similarity: pixel q = t + [a -b; b a] p shows the texture at p. With
/// gain, bias, noise and blur.
struct View {
  Similarity warp;
  double gain = 1.0;
  double bias = 0.0;
  double noise = 0.0;
  double blur_px = 0.0;
  double gain_before = 1.0;  ///< of the image that it is compared with

  [[nodiscard]] cv::Mat render() const {
    cv::Mat values(kViewHeight, kViewWidth, CV_64F);
    const double scale_sq = warp.a * warp.a + warp.b * warp.b;
    for (int y = 0; y < kViewHeight; ++y) {
      for (int x = 0; x < kViewWidth; ++x) {
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

/// Errors of the points that were found.
class Distances {
 public:
  Distances(std::vector<double> px, std::size_t num_asked)
      : px_(std::move(px)), num_asked_(num_asked) {
    std::sort(px_.begin(), px_.end());
  }
  [[nodiscard]] double quantile_px(double share) const {
    return px_.empty()
               ? std::numeric_limits<double>::quiet_NaN()
               : px_.at(static_cast<std::size_t>(share * static_cast<double>(px_.size() - 1)));
  }
  [[nodiscard]] double found() const {
    return static_cast<double>(px_.size()) / static_cast<double>(num_asked_);
  }
  /// As the table in docs/lab/accuracy_notes.md has them.
  [[nodiscard]] std::string row() const {
    return fmt::format("{:.3f} / {:.3f} / {:.2f}", quantile_px(0.5), quantile_px(0.9), found());
  }

 private:
  std::vector<double> px_;
  std::size_t num_asked_;
};

/// Points all over an image, and in a view of it, with starts that are wrong.
struct PlantedPoints {
  explicit PlantedPoints(const View& of) : view(of) {
    constexpr float kMargin_px = 40.0F;
    constexpr float kStep_px = 16.0F;
    constexpr float kStartOff_px = 1.5F;  ///< in x and in y
    const Similarity& w = view.warp;
    for (float y = kMargin_px; y < kViewHeight - kMargin_px; y += kStep_px) {
      for (float x = kMargin_px; x < kViewWidth - kMargin_px; x += kStep_px) {
        from.emplace_back(x, y);
        truth.emplace_back(w.x + w.a * x - w.b * y, w.y + w.b * x + w.a * y);
        start.push_back(truth.back() + cv::Point2f(kStartOff_px, -kStartOff_px));
      }
    }
  }

  View view;
  cv::Mat before = View{{}, view.gain_before, 128.0 * (1.0 - view.gain_before)}.render();
  cv::Mat after = view.render();
  std::vector<cv::Point2f> from;
  std::vector<cv::Point2f> truth;
  std::vector<cv::Point2f> start;
};

Distances errors_of_patches(const PlantedPoints& points) {
  const TestPyramid before(points.before);
  const TestPyramid after(points.after);
  std::vector<double> errors_px;
  for (std::size_t i = 0; i < points.from.size(); ++i) {
    const cv::Point2f& from = points.from[i];
    const cv::Point2f& start = points.start[i];
    Patch patch;
    EXPECT_TRUE(cut_patch(before.bordered, from.x, from.y, patch));
    const PatchMatch found = align_patch(patch, after.bordered, {start.x, start.y}, 1);
    if (found.correlation < 0.7F) {
      continue;
    }
    errors_px.push_back(cv::norm(cv::Point2f(found.warp.x, found.warp.y) - points.truth[i]));
  }
  return {errors_px, points.from.size()};
}

/// OpenCV's errors, called as KltFrontEnd calls it, from the same starts.
Distances errors_of_lucas_kanade(const PlantedPoints& points) {
  const int side = FeatureOptions().klt_window;
  std::vector<cv::Point2f> found = points.start;
  std::vector<unsigned char> is_found;
  cv::calcOpticalFlowPyrLK(points.before, points.after, points.from, found, is_found, cv::noArray(),
                           cv::Size(side, side), 1,
                           {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 15, 0.015},
                           cv::OPTFLOW_USE_INITIAL_FLOW);
  std::vector<double> errors_px;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (is_found[i] != 0) {
      errors_px.push_back(cv::norm(found[i] - points.truth[i]));
    }
  }
  return {errors_px, points.from.size()};
}

struct Case {
  std::string name;
  View view;
  double median_px;  ///< bounds: about 1.25 times what was found
  double p90_px;
  double found;
};

/// Noise is in gray values; it and the blur are of the second image only.
TEST(PatchAlignment, ErrorsOfPlantedWarps) {
  constexpr float kX = 1.3F;
  constexpr float kY = -0.4F;
  const Similarity shifted{kX, kY};
  for (const Case& one : std::vector<Case>{
           {"no warp", {}, 0.001, 0.002, 1.0},
           {"3.37, -2.81 px", {{3.37F, -2.81F}}, 0.02, 0.025, 1.0},
           {"1.25, -2.25 px", {{1.25F, -2.25F}}, 0.02, 0.025, 1.0},
           {"scale 1.06", {{-8.0F, 5.5F, 1.06F, 0.0F}}, 0.02, 0.025, 1.0},
           {"scale 0.99, turn 0.03", {{4.2F, -6.0F, 0.99F, 0.03F}}, 0.02, 0.025, 1.0},
           {"noise 2", {shifted, 1.0, 0.0, 2.0}, 0.045, 0.08, 0.99},
           {"noise 5", {shifted, 1.0, 0.0, 5.0}, 0.105, 0.21, 0.99},
           {"noise 10", {shifted, 1.0, 0.0, 10.0}, 0.21, 0.41, 0.97},
           {"blur 0.5 px", {shifted, 1.0, 0.0, 0.0, 0.5}, 0.04, 0.085, 0.99},
           {"blur 1 px", {shifted, 1.0, 0.0, 0.0, 1.0}, 0.2, 0.39, 0.99},
           {"scale 0.85", {{kX, kY, 0.85F, 0.0F}}, 0.02, 0.025, 0.99},
           {"scale 1.1", {{kX, kY, 1.1F, 0.0F}}, 0.02, 0.025, 0.99},
           {"scale 1.2", {{kX, kY, 1.2F, 0.0F}}, 0.02, 0.025, 0.93},
           {"turn 0.1", {{kX, kY, 1.0F, 0.1F}}, 0.02, 0.025, 0.99},
           {"gain 0.7, bias 20", {shifted, 0.7, 20.0}, 0.02, 0.03, 0.99},
           {"gain 0.4, bias 110", {shifted, 0.4, 110.0}, 0.03, 0.05, 0.99},
           {"gain 2.5", {shifted, 1.0, 0.0, 0.0, 0.0, 0.4}, 0.03, 0.05, 0.99},
           {"noise 2, blur 1 px, scale 1.1",
            {{kX, kY, 1.1F, 0.0F}, 1.0, 0.0, 2.0, 1.0},
            0.2,
            0.39,
            0.97},
       }) {
    SCOPED_TRACE(one.name);
    const PlantedPoints points(one.view);
    const Distances errors = errors_of_patches(points);
    std::cout << "| " << one.name << " | " << errors.row() << " | "
              << errors_of_lucas_kanade(points).row() << " |\n";
    EXPECT_LE(errors.quantile_px(0.5), one.median_px);
    EXPECT_LE(errors.quantile_px(0.9), one.p90_px);
    EXPECT_GE(errors.found(), one.found);
  }
}

TEST(PatchAlignment, WhatIsNotThereIsNotFound) {
  const TestPyramid before(View().render());
  cv::Mat other(kViewHeight, kViewWidth, CV_8U);
  cv::RNG(9).fill(other, cv::RNG::UNIFORM, 0, 256);
  const TestPyramid after(other);
  int found = 0;
  for (float x = 40.0F; x < 280.0F; x += 8.0F) {
    Patch patch;
    ASSERT_TRUE(cut_patch(before.bordered, x, 120.0F, patch));
    found += align_patch(patch, after.bordered, {x, 120.0F}, 2).correlation > 0.7F ? 1 : 0;
  }
  EXPECT_LE(found, 3);
}

TEST(PatchAlignment, APlainSurfaceIsNotCut) {
  const TestPyramid plain(cv::Mat(kViewHeight, kViewWidth, CV_8U, cv::Scalar(90)));
  Patch patch;
  EXPECT_FALSE(cut_patch(plain.bordered, 100.0F, 100.0F, patch));
}

/// Without it `unit.portable`, which sets STEMVO_PORTABLE, would run the same code once more.
TEST(InstructionSet, IsThePortableOneWhereThatIsAskedFor) {
  const char* value = std::getenv("STEMVO_PORTABLE");
  if (value != nullptr && std::string_view(value) == "1") {
    EXPECT_FALSE(uses_avx2());
    return;
  }
#if defined(__x86_64__)
  EXPECT_EQ(uses_avx2(), __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"));
#endif
}

}  // namespace
}  // namespace stemvo
