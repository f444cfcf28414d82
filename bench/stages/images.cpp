// SPDX-License-Identifier: MIT
// From the file to what the points are looked for on: decode, stem, contrast, pyramid, road image.
#include "stages/images.hpp"

#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/image_file.hpp"
#include "stages/drive.hpp"

namespace stemvo::bench {
namespace {

using benchmark::State;

const cv::Mat& frame_of(const State& state) {
  return frames().pixels[static_cast<std::size_t>(state.iterations()) % frames().pixels.size()];
}

/// The first frame as a file of the kind asked for: as it is, or turned into the other kind.
std::filesystem::path file_of_kind(bool as_color) {
  if (as_color == frames().is_color) {
    return frames().sequence.files[0];
  }
  cv::Mat turned;
  cv::cvtColor(frames().pixels.front(), turned, as_color ? cv::COLOR_GRAY2BGR : cv::COLOR_RGB2GRAY);
  const auto file = frames().folder / (as_color ? "color.png" : "gray.png");
  cv::imwrite(file.string(), turned);
  return file;
}

void decode(State& state, bool as_color) {
  const auto file = file_of_kind(as_color);
  for (auto _ : state) {
    auto image = io::read_image(file, as_color);
    if (!image) {
      state.SkipWithError(image.error().message.c_str());
      return;
    }
    benchmark::DoNotOptimize(image->data);
  }
}

void decode_by_opencv(State& state, bool as_color) {
  const auto file = file_of_kind(as_color);
  for (auto _ : state) {
    const cv::Mat image =
        cv::imread(file.string(), as_color ? cv::IMREAD_COLOR : cv::IMREAD_GRAYSCALE);
    benchmark::DoNotOptimize(image.data);
  }
}

void stem(State& state, const StemOptions& options) {
  const Stem model = load_stem(options);
  for (auto _ : state) {
    auto channel = model.apply(frame_of(state));
    if (!channel) {
      state.SkipWithError(channel.error().message.c_str());
      return;
    }
    benchmark::DoNotOptimize(channel->values.data);
  }
}

void stem_load(State& state) {
  for (auto _ : state) {
    benchmark::DoNotOptimize(load_stem({}).info().num_filters);
  }
}

void contrast(State& state) {
  ContrastNormalization normalization(chain().config.stem);
  for (auto _ : state) {
    benchmark::DoNotOptimize(normalization.apply(chain().channel).pixels.data);
  }
}

void pyramid(State& state) {
  const auto front_end = create_front_end(chain().config.features);
  for (auto _ : state) {
    benchmark::DoNotOptimize(front_end->prepare(chain().images.back(), {}));
  }
}

void road_image(State& state) {
  const Camera& camera = chain().camera;
  ContrastNormalization contrast({.tracking_resolution = TrackingResolution::kNative});
  for (auto _ : state) {
    const Channel channel = road_channel(frame_of(state), camera);
    benchmark::DoNotOptimize(make_road_image(contrast.apply(channel), camera));
  }
}

BENCHMARK_CAPTURE(decode, gray, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(decode, color, true)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(decode_by_opencv, gray, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(decode_by_opencv, color, true)->Unit(benchmark::kMillisecond);
BENCHMARK(stem_load)->Unit(benchmark::kMillisecond);
BENCHMARK(contrast)->Unit(benchmark::kMillisecond);
BENCHMARK(pyramid)->Unit(benchmark::kMillisecond);
BENCHMARK(road_image)->Unit(benchmark::kMillisecond);

}  // namespace

void register_stems(const std::filesystem::path& models) {
  const auto add = [](const std::string& name, const StemOptions& options) {
    benchmark::RegisterBenchmark(("stem/" + name).c_str(), stem, options)
        ->Unit(benchmark::kMillisecond);
  };
  StemOptions options;
  add("default", options);
  for (const int sampling_px : {1, 2}) {
    options.sampling_px = sampling_px;
    add("default/every_" + std::to_string(sampling_px) + "_px", options);
  }
  options = {};
  options.model = "gray";
  add("gray", options);
  if (models.empty()) {
    return;
  }
  for (const auto& entry : std::filesystem::directory_iterator(models)) {
    if (entry.path().extension() == ".onnx") {
      options.model = entry.path().string();
      add(entry.path().stem().string(), options);
    }
  }
}

}  // namespace stemvo::bench
