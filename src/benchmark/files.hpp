// SPDX-License-Identifier: MIT
#pragma once

#include "stemvo/benchmark/benchmark.hpp"

namespace stemvo::benchmark {

/// The whole report as Markdown: a table over all sequences, then one per sequence with the null
/// row and, where all official frames ran, the published numbers. No times.
[[nodiscard]] std::string format_markdown(const BenchmarkReport& report);
/// The same as JSON.
[[nodiscard]] std::string format_json(const BenchmarkReport& report);
/// Frames per second of each run, which no two calls share.
[[nodiscard]] std::string format_speed_json(const BenchmarkReport& report);

/// OUT/NN.png: the truth and, of each configuration, the trajectory without ground truth for the
/// first and with true steps for the others, as far as they are done.
[[nodiscard]] Status write_picture(const BenchmarkRequest& request,
                                   const BenchmarkSequence& sequence);

/// All of the above, and the picture of `last`.
[[nodiscard]] Status write_files(const BenchmarkRequest& request,
                                 const BenchmarkReport& report,
                                 const BenchmarkSequence& last);

}  // namespace stemvo::benchmark
