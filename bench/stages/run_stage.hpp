// SPDX-License-Identifier: MIT
#pragma once

#include <benchmark/benchmark.h>

#include "timing/stage_timer.hpp"

namespace stemvo::bench {

/// Calls `work` once per iteration; what counts is the processor time of one stage inside it, as
/// `run
/// --timing` takes it. For stages that cannot be called alone. Register with UseManualTime.
template <typename Work>
void run_stage(benchmark::State& state, Stage stage, const Work& work) {
  for (auto _ : state) {
    const StageRecorder recorder;
    work();
    const double seconds = recorder.cpu_ms(stage) / 1e3;
    if (!(seconds > 0.0)) {
      state.SkipWithError("the stage was not met");
      return;
    }
    state.SetIterationTime(seconds);
  }
}

}  // namespace stemvo::bench
