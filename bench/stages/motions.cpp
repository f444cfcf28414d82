// SPDX-License-Identifier: MIT
// From matches to a metric pose: the two-view pieces, localization, window refinement, road
// scale.
#include <benchmark/benchmark.h>

#include "odometry/robust_models.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stages/drive.hpp"
#include "stages/run_stage.hpp"

namespace stemvo::bench {
namespace {

using benchmark::State;

void homography(State& state) {
  const Chain& c = chain();
  for (auto _ : state) {
    benchmark::DoNotOptimize(estimate_homography({c.matches.prev_uv, c.matches.cur_uv},
                                                 c.config.two_view, c.config.seed));
  }
}

void fundamental(State& state) {
  const Chain& c = chain();
  for (auto _ : state) {
    benchmark::DoNotOptimize(estimate_fundamental({c.matches.prev_uv, c.matches.cur_uv},
                                                  c.config.two_view, c.config.seed));
  }
}

void essential(State& state) {
  const Chain& c = chain();
  for (auto _ : state) {
    benchmark::DoNotOptimize(estimate_essential({c.matches.prev_uv, c.matches.cur_uv}, c.camera,
                                                c.config.two_view, c.config.seed));
  }
}

void two_view_refinement(State& state) {
  const Chain& c = chain();
  const TwoViewEstimator estimator(c.config);
  run_stage(state, "two-view refinement", [&] {
    benchmark::DoNotOptimize(estimator.measure({c.matches.prev_uv, c.matches.cur_uv}, c.camera,
                                               /*is_initializing=*/false));
  });
}

void two_view(State& state, bool is_initializing) {
  const Chain& c = chain();
  const TwoViewEstimator estimator(c.config);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        estimator.measure({c.matches.prev_uv, c.matches.cur_uv}, c.camera, is_initializing));
  }
}

/// The last frame, from the window as it was before it.
void run_last_frame(State& state, const char* stage) {
  const Chain& c = chain();
  run_stage(state, stage, [&] {
    WindowEstimator estimator = *c.estimator;
    LocalizedFrame localized = estimator.localize(c.last);
    estimator.optimize(c.last, localized);
  });
}

void localization(State& state) { run_last_frame(state, "localization"); }
void window_refinement(State& state) { run_last_frame(state, "window refinement"); }
void road_scale(State& state) { run_last_frame(state, "road scale"); }

BENCHMARK(homography)->Unit(benchmark::kMillisecond);
BENCHMARK(fundamental)->Unit(benchmark::kMillisecond);
BENCHMARK(essential)->Unit(benchmark::kMillisecond);
BENCHMARK(two_view_refinement)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(two_view, initializing, true)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(two_view, tracking, false)->Unit(benchmark::kMillisecond);
BENCHMARK(localization)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(window_refinement)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(road_scale)->UseManualTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stemvo::bench
