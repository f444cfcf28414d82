// SPDX-License-Identifier: MIT
// Micro-benchmarks of every stage, one thread. $STEMVO_BENCH_SEQUENCE: a KITTI folder instead of a
// rendered drive; $STEMVO_BENCH_MODELS: a folder of further models.
#include <cstdio>
#include <cstdlib>
#include <exception>

#include <benchmark/benchmark.h>
#include <opencv2/core/utility.hpp>

#include "pipeline/frame_pipeline.hpp"
#include "stages/drive.hpp"
#include "stages/images.hpp"
#include "stemvo/version.hpp"

int main(int argc, char** argv) {
  try {
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) {
      return 2;
    }
    const char* models = std::getenv("STEMVO_BENCH_MODELS");
    stemvo::bench::register_stems(models != nullptr ? models : "");
    const auto one_thread = stemvo::pipeline::limit_threads(1);
    const auto& frames = stemvo::bench::frames();
    benchmark::AddCustomContext("stemvo", std::string(stemvo::version()));
    benchmark::AddCustomContext("frames",
                                frames.sequence.name + (frames.is_color ? ", colour" : ", gray"));
    benchmark::RunSpecifiedBenchmarks();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
  }
  return 0;
}
