// SPDX-License-Identifier: MIT
// No test, a measurement of the default model on a frame of KITTI's size:
//   stemvo_unit_tests --gtest_also_run_disabled_tests --gtest_filter='*StemTiming*'
#include <algorithm>
#include <ctime>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "models/manifest.hpp"
#include "stem/stem.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

/// Of the whole process, so that other programs on the machine do not count.
double cpu_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

template <typename Function>
double median_cpu_ms(const Function& function) {
  std::vector<double> times;
  for (int i = 0; i < 60; ++i) {
    const double start = cpu_ms();
    function();
    times.push_back(cpu_ms() - start);
  }
  std::nth_element(times.begin(), times.begin() + 30, times.end());
  return times[30];
}

TEST(DISABLED_StemTiming, DefaultModelOnAFrameOfKitti) {
  const std::string models = std::string(STEMVO_SOURCE_DIR) + "/models";
  const int threads_before = cv::getNumThreads();
  for (const int threads : {1, 2}) {
    cv::setNumThreads(threads);
    for (const int sampling : {4, 2, 1}) {
      StemOptions options;
      options.sampling_px = sampling;
      const double create_ms = median_cpu_ms([&] { (void)create_stem(options, models); });
      const auto stem = create_stem(options, models);
      ASSERT_TRUE(stem) << stem.error().message;
      ChannelStretch stretch(options);
      const cv::Mat gray = testing::textured_frame({1242, 376}, CV_8UC1);
      const cv::Mat colour = testing::textured_frame({1242, 376}, CV_8UC3);
      const double gray_ms = median_cpu_ms([&] { (void)stem->apply(gray); });
      const double colour_ms = median_cpu_ms([&] { (void)stem->apply(colour); });
      const Channel channel = *stem->apply(gray);
      const double stretch_ms = median_cpu_ms([&] { (void)stretch.apply(channel); });
      fmt::print(
          "CPU time, {} thread(s), sampling {}: load {:.1f} ms, gray {:.2f} ms, colour {:.2f} ms, "
          "stretch "
          "and "
          "upsampling {:.2f} ms\n",
          threads, sampling, create_ms, gray_ms, colour_ms, stretch_ms);
    }
  }
  cv::setNumThreads(threads_before);
}

}  // namespace
}  // namespace stemvo
