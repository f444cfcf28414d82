// SPDX-License-Identifier: MIT
#include <algorithm>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmark/benchmark.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "progress.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kBenchmarkFooter =
    R"(KITTI_ROOT holds sequences/NN (as 'stemvo run' takes them) and poses/NN.txt.
Each sequence runs with the default configuration and the paper's, each with
metres from the camera's height (no ground truth, no alignment) and with
per-step ground-truth scale (the paper's protocol).

--out receives benchmark.md and benchmark.json, report.html, speed.json, and all
files of every run under runs/. The paper's and other published numbers stand
beside a sequence where all of its official frames ran.

Stopped with Ctrl-C, the same command goes on where it was: a run is repeated
only where its configuration, the program, the model, the frames, the
calibration or the ground truth changed. A sequence that fails is a row with the
reason; the exit code is 1 then. A sequence without ground truth is no failure:
its errors are '-'.

Examples:
  stemvo benchmark kitti --out result
  stemvo benchmark kitti --out result --sequences 00,05)";

struct BenchmarkArguments {
  BenchmarkRequest request;
  bool is_quiet = false;
};

Expected<int> benchmark(BenchmarkArguments& arguments) {
  BenchmarkRequest& request = arguments.request;
  request.command = command_line();
  request.published = data_folder("config") / "published.json";
  STEMVO_TRY_GET(const Config paper, load_config(data_folder("config") / "paper.yaml"));
  request.configurations = {{"default", Config{}}, {"paper", paper}};
  std::optional<Progress> progress;
  request.on_run = [&](const std::string& run) {
    if (!arguments.is_quiet) {
      print_note(run + '\n');
    }
    progress.emplace("frames", arguments.is_quiet);
    return !is_interrupted();
  };
  request.on_frame = [&](std::size_t done, std::size_t total) { return (*progress)(done, total); };
  STEMVO_TRY_GET(const BenchmarkSummary summary, run_benchmark(request));
  std::ranges::for_each(summary.failures, print_error);
  std::ranges::for_each(summary.warnings, print_warning);
  print_json(nlohmann::ordered_json::parse(summary.json));
  if (summary.interrupted) {
    print_warning("interrupted; what is done is kept, the same command goes on from there");
    return kExitInterrupted;
  }
  if (!arguments.is_quiet) {
    print(fmt::format("table: {}\nreport: {}\n", (request.out_dir / "benchmark.md").string(),
                      (request.out_dir / "report.html").string()));
  }
  return summary.failures.empty() ? kExitDone : kExitFailed;
}

void add_options(CLI::App& command, BenchmarkArguments& arguments) {
  BenchmarkRequest& request = arguments.request;
  command.add_option("KITTI_ROOT", request.kitti_root, "Folder that holds sequences and poses")
      ->required()
      ->type_name("");
  add_out_folder(command, request.out_dir);
  command.add_option("--sequences", request.sequences, "Only these, e.g. 00,02; default: all")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NN,..");
  add_threads_option(command, request.num_threads);
  command.add_flag("--quiet", arguments.is_quiet, "Only errors and warnings");
}

}  // namespace

CLI::App* add_benchmark(CLI::App& app, Action& action) {
  return add_command<BenchmarkArguments>(
      app, action, {"benchmark", "Run all sequences, compare with published", kBenchmarkFooter},
      add_options, benchmark);
}

}  // namespace stemvo::apps
