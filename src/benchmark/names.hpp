// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "stemvo/benchmark/benchmark.hpp"

namespace stemvo::benchmark {

/// For people: "camera height", "true steps".
inline std::string_view words_for(ScaleProtocol protocol) {
  return protocol == ScaleProtocol::kCameraHeight ? "camera height" : "true steps";
}

/// "default, camera height".
inline std::string title_of(const BenchmarkRun& run) {
  return fmt::format("{}, {}", run.configuration, words_for(run.protocol));
}

/// "all 4541 frames", "clip 0:200 of 4541", "frames 0:60".
inline std::string describe_frames(const BenchmarkSequence& sequence) {
  const FrameRange& range = sequence.frames;
  if (sequence.is_complete) {
    return fmt::format("all {} frames", range.end - range.begin);
  }
  if (sequence.official_frames) {
    return fmt::format("clip {}:{} of {}", range.begin, range.end, *sequence.official_frames);
  }
  return fmt::format("frames {}:{}", range.begin, range.end);
}

/// The numbers of any run that has ground truth: path, segments and the null row are the same in
/// all of them.
inline const Metrics* any_metrics(const BenchmarkSequence& sequence) {
  const auto found =
      std::find_if(sequence.runs.begin(), sequence.runs.end(),
                   [](const BenchmarkRun& run) { return run.report && run.report->metrics; });
  return found == sequence.runs.end() ? nullptr : &*found->report->metrics;
}

}  // namespace stemvo::benchmark
