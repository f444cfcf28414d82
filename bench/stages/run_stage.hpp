// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include <benchmark/benchmark.h>

#include "timing/stage_timer.hpp"

namespace stemvo::bench {

/// Calls `work` once per iteration; what counts is the processor time of one stage inside it, as
/// `run --timing` names and takes it. For stages that cannot be called alone. Register with
/// UseManualTime.
template <typename Work>
void run_stage(benchmark::State& state, const char* stage, const Work& work) {
  for (auto _ : state) {
    const StageRecorder recorder;
    work();
    const auto stages = recorder.report().stages;
    const auto found = std::ranges::find(stages, stage, &StageTiming::name);
    if (found == stages.end() || !(found->cpu_s > 0.0)) {
      state.SkipWithError("the stage was not met");
      return;
    }
    state.SetIterationTime(found->cpu_s);
  }
}

}  // namespace stemvo::bench
