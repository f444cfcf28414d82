// SPDX-License-Identifier: MIT
// Points from image to image: detection, patches, KLT, ORB.
#include <array>
#include <utility>

#include <benchmark/benchmark.h>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "stages/drive.hpp"
#include "stages/run_stage.hpp"

namespace stemvo::bench {
namespace {

using benchmark::State;
using Prepared = std::shared_ptr<const ImagePyramid>;

FeatureOptions options_of(FeatureMethod method) {
  FeatureOptions options = chain().config.features;
  options.method = method;
  return options;
}

/// All images, prepared; then over and over from the first to the last, as in a drive.
class Images {
 public:
  explicit Images(FeatureMethod method)
      : method_(method), front_end_(create_front_end(options_of(method))) {
    for (const ChannelImage& image : chain().images) {
      prepared_.push_back(front_end_->prepare(image, {}));
    }
  }
  /// To the next image; from the last one, to the second by way of the first (not measured).
  template <typename Measured>
  void advance(const Measured& measured) {
    if (next_ == 0 || next_ == prepared_.size()) {
      front_end_ = create_front_end(options_of(method_));
      static_cast<void>(front_end_->process(prepared_.front(), {}));
      next_ = 1;
    }
    measured(*front_end_, prepared_[next_++]);
  }
  [[nodiscard]] FrontEnd& front_end() { return *front_end_; }
  [[nodiscard]] const std::vector<Prepared>& prepared() const { return prepared_; }

 private:
  FeatureMethod method_;
  std::unique_ptr<FrontEnd> front_end_;
  std::vector<Prepared> prepared_;
  std::size_t next_ = 0;
};

void run_tracker(State& state, FeatureMethod method, const char* stage) {
  Images images(method);
  run_stage(state, stage, [&] {
    images.advance([](FrontEnd& front_end, const Prepared& image) {
      benchmark::DoNotOptimize(front_end.process(image, {}));
    });
  });
}

/// Corners where the tracks of the frame before left room.
void detection(State& state) { run_tracker(state, FeatureMethod::kPatch, "detection"); }

void patches(State& state) { run_tracker(state, FeatureMethod::kPatch, "tracking"); }

/// Forward and back.
void klt(State& state) { run_tracker(state, FeatureMethod::kKlt, "tracking"); }

/// OpenCV's tracker alone, there only, on all levels of the pyramid, with as many corners.
void klt_forward(State& state) {
  const FeatureOptions& features = chain().config.features;
  const cv::Size window(features.klt_window, features.klt_window);
  const auto& images = chain().images;
  std::array<std::vector<cv::Mat>, 2> pyramids;
  for (std::size_t i = 0; i < 2; ++i) {
    cv::buildOpticalFlowPyramid(images[images.size() - 2 + i].pixels, pyramids.at(i), window,
                                features.klt_levels - 1);
  }
  std::vector<cv::Point2f> from;
  cv::goodFeaturesToTrack(images[images.size() - 2].pixels, from, features.max_features,
                          features.corner_quality, features.min_distance_px);
  const cv::TermCriteria criteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 30, 0.01);
  for (auto _ : state) {
    std::vector<cv::Point2f> to;
    std::vector<unsigned char> found;
    cv::calcOpticalFlowPyrLK(pyramids[0], pyramids[1], from, to, found, cv::noArray(), window,
                             features.klt_levels - 1, criteria);
    benchmark::DoNotOptimize(to.data());
  }
  state.counters["points"] = static_cast<double>(from.size());
}

void orb_detect_and_describe(State& state) {
  const auto front_end = create_front_end(options_of(FeatureMethod::kOrb));
  for (auto _ : state) {
    benchmark::DoNotOptimize(front_end->prepare(chain().images.back(), {}));
  }
}

void orb_match(State& state) {
  Images images(FeatureMethod::kOrb);
  std::size_t i = 0;
  run_stage(state, "tracking", [&] {
    if (i == 0) {
      static_cast<void>(images.front_end().process(images.prepared().front(), {}));
    }
    ++i;
    benchmark::DoNotOptimize(
        images.front_end().process(images.prepared()[i % images.prepared().size()], {}));
  });
}

BENCHMARK(detection)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(patches)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(klt)->Name("klt/both_ways")->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(klt_forward)->Name("klt/opencv_forward")->Unit(benchmark::kMillisecond);
BENCHMARK(orb_detect_and_describe)->Name("orb/detect_and_describe")->Unit(benchmark::kMillisecond);
BENCHMARK(orb_match)->Name("orb/match")->UseManualTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stemvo::bench
