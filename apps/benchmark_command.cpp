// SPDX-License-Identifier: MIT
#include <cstdio>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "commands.hpp"
#include "console.hpp"
#include "install_paths.hpp"
#include "interrupt.hpp"
#include "options.hpp"
#include "progress.hpp"
#include "stemvo/benchmark/benchmark.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kFooter =
    R"(KITTI_ROOT holds sequences/NN (as 'stemvo run' takes them) and poses/NN.txt. Each sequence runs with
the default configuration and the paper's, each with metres from the camera's height (no ground
truth, no alignment) and with true steps (the paper's protocol).

--out receives benchmark.md and benchmark.json, a picture NN.png per sequence, speed.json, and all files
of every run under runs/. The paper's and other published numbers stand beside a sequence where all of
its official frames ran.

Stopped with Ctrl-C, the same command goes on where it was: a run is repeated only where its
configuration, the program, the model, the frames, the calibration or the ground truth changed. A
sequence that fails is a row with the reason; the exit code is 1 then. A sequence without ground truth
is no failure: its errors are '-'.

Examples:
  stemvo benchmark kitti --out result
  stemvo benchmark kitti --out result --sequences 00,05)";

struct Arguments {
  BenchmarkRequest request;
  bool is_quiet = false;
};

/// One line of progress per run that is not kept.
class Console {
 public:
  explicit Console(bool is_quiet) : is_quiet_(is_quiet) {}

  bool update(const BenchmarkProgress& at) {
    if (at.frames_done == 0) {
      progress_ = std::make_unique<Progress>("frames", is_quiet_);
      if (!is_quiet_) {
        const std::string note = at.note.empty() ? "" : fmt::format(" (again: {})", at.note);
        const std::string line =
            fmt::format("{}/{} {}, {}, {}{}\n", at.run + 1, at.num_runs, at.sequence,
                        at.configuration, to_string(at.protocol), note);
        std::fwrite(line.data(), 1, line.size(), stderr);
      }
      return !is_interrupted();
    }
    return progress_->update(at.frames_done, at.num_frames);
  }

 private:
  bool is_quiet_;
  std::unique_ptr<Progress> progress_;
};

void print_problems(const BenchmarkReport& report) {
  for (const BenchmarkSequence& sequence : report.sequences) {
    if (!sequence.problem.empty()) {
      print_error(fmt::format("{}: {}", sequence.name, sequence.problem));
    }
    for (const BenchmarkRun& run : sequence.runs) {
      const std::string name =
          fmt::format("{}, {}, {}: ", sequence.name, run.configuration, to_string(run.protocol));
      if (run.state == BenchmarkState::kFailed) {
        print_error(name + run.problem);
      }
      for (const std::string& warning : run.warnings) {
        print_warning(name + warning);
      }
    }
  }
}

int benchmark(Arguments& arguments) {
  BenchmarkRequest& request = arguments.request;
  request.models_dir = data_folder("models");
  request.configurations.push_back({"default", Config{}});
  const Expected<Config> paper = load_config(data_folder("config") / "paper.yaml");
  if (!paper) {
    print_error(paper.error().message);
    return kExitFailed;
  }
  request.configurations.push_back({"paper", *paper});
  Console console(arguments.is_quiet);
  const Expected<BenchmarkReport> report = run_benchmark(
      request, [&console](const BenchmarkProgress& at) { return console.update(at); });
  if (!report) {
    print_error(report.error().message);
    return kExitFailed;
  }
  print_problems(*report);
  if (report->interrupted) {
    print_warning("interrupted; what is done is kept, the same command goes on from there");
    return kExitInterrupted;
  }
  if (!arguments.is_quiet) {
    print(fmt::format("report: {}\n", (request.out_dir / "benchmark.md").string()));
  }
  return has_failures(*report) ? kExitFailed : kExitDone;
}

}  // namespace

CLI::App* add_benchmark(CLI::App& app, Action& action) {
  CLI::App* command = app.add_subcommand("benchmark", "Run all sequences, compare with published");
  const auto arguments = std::make_shared<Arguments>();
  BenchmarkRequest& request = arguments->request;
  command->add_option("KITTI_ROOT", request.kitti_root, "Folder that holds sequences and poses")
      ->required()
      ->type_name("");
  command->add_option("--out", request.out_dir, "Folder for the results; created")
      ->required()
      ->type_name("DIR");
  command->add_option("--sequences", request.sequences, "Only these, e.g. 00,02; default: all")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NN,..");
  command->add_option("--threads", request.num_threads, "Threads; 0 (default): all cores")
      ->type_name("N")
      ->check(in_range(0, 1024));
  command->add_flag("--quiet", arguments->is_quiet, "Only errors and warnings");
  command->footer(kFooter);
  command->callback(
      [arguments, &action] { action = [arguments] { return benchmark(*arguments); }; });
  return command;
}

}  // namespace stemvo::apps
