// SPDX-License-Identifier: MIT
// Cost of measuring: a frame meets some 15 timers.
#include <benchmark/benchmark.h>

#include "timing/stage_timer.hpp"

namespace stemvo::bench {
namespace {

void timer_without_recorder(benchmark::State& state) {
  for (auto _ : state) {
    const StageTimer timer(Stage::kStem);
    benchmark::ClobberMemory();
  }
}

void timer_with_recorder(benchmark::State& state) {
  StageRecorder recorder;
  for (auto _ : state) {
    const StageTimer timer(Stage::kStem);
    benchmark::ClobberMemory();
  }
}

BENCHMARK(timer_without_recorder)->Name("timer/off");
BENCHMARK(timer_with_recorder)->Name("timer/on");

}  // namespace
}  // namespace stemvo::bench
