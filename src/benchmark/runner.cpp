// SPDX-License-Identifier: MIT
#include "benchmark/runner.hpp"

#include <chrono>
#include <utility>

#include <fmt/format.h>

#include "benchmark/fingerprint.hpp"
#include "stemvo/pipeline/run.hpp"

namespace stemvo::benchmark {
namespace {

namespace fs = std::filesystem;

Config config_of(const BenchmarkConfiguration& configuration, ScaleProtocol protocol) {
  Config config = configuration.config;
  config.scale.source = protocol == ScaleProtocol::kCameraHeight ? "camera_height" : "ground_truth";
  return config;
}

void finish(BenchmarkRun& run, BenchmarkState state, std::string problem = {}) {
  run.state = state;
  run.problem = std::move(problem);
}

/// The result of an earlier call where nothing changed; else says in `note` what did.
std::optional<MetricsReport> kept_report(const fs::path& folder,
                                         const Fingerprint& now,
                                         std::string& note) {
  const Expected<Fingerprint> before = read_fingerprint(folder);
  if (!before) {
    return std::nullopt;
  }
  note = describe_change(*before, now);
  if (!note.empty()) {
    return std::nullopt;
  }
  const Expected<MetricsReport> report = read_metrics_json(folder / "metrics.json");
  if (!report) {
    note = report.error().message;
    return std::nullopt;
  }
  return *report;
}

void run_now(const RunRequest& request,
             const Fingerprint& fingerprint,
             Reporter& reporter,
             BenchmarkRun& run) {
  remove_fingerprint(request.out_dir);
  Expected<RunSummary> summary = run_sequence(
      request,
      [&reporter](std::size_t done, std::size_t total) { return reporter.update(done, total); });
  if (!summary) {
    return finish(run, BenchmarkState::kFailed, summary.error().message);
  }
  if (!summary->written) {
    return finish(run, BenchmarkState::kFailed, summary->written.error().message);
  }
  if (summary->interrupted) {
    return;
  }
  // What is reported is what was written, so that a kept result gives the same report.
  const Expected<MetricsReport> report = read_metrics_json(request.out_dir / "metrics.json");
  const Status kept = report ? write_fingerprint(request.out_dir, fingerprint) : report.error();
  if (!kept) {
    return finish(run, BenchmarkState::kFailed, kept.error().message);
  }
  run.report = *report;
  run.warnings = std::move(summary->warnings);
  finish(run, BenchmarkState::kDone);
}

}  // namespace

fs::path run_folder(const fs::path& out_dir, const std::string& sequence, const BenchmarkRun& run) {
  return out_dir / "runs" / sequence /
         fmt::format("{}_{}", run.configuration, to_string(run.protocol));
}

void Reporter::start(const std::string& sequence, const BenchmarkRun& run) {
  progress_ = {.sequence = sequence,
               .configuration = run.configuration,
               .protocol = run.protocol,
               .run = num_started_++,
               .num_runs = num_runs_,
               .frames_done = 0,
               .num_frames = 0,
               .note = {}};
}

bool Reporter::update(std::size_t frames_done, std::size_t num_frames, const std::string& note) {
  progress_.frames_done = frames_done;
  progress_.num_frames = num_frames;
  progress_.note = note;
  is_stopped_ = is_stopped_ || (callback_ && !callback_(progress_));
  return !is_stopped_;
}

void complete_run(const BenchmarkRequest& request,
                  const BenchmarkConfiguration& configuration,
                  const std::string& sequence_name,
                  Reporter& reporter,
                  BenchmarkRun& run) {
  RunRequest one;
  one.sequence_dir = request.kitti_root / "sequences" / sequence_name;
  one.out_dir = run_folder(request.out_dir, sequence_name, run);
  one.models_dir = request.models_dir;
  one.config = config_of(configuration, run.protocol);
  one.num_threads = request.num_threads;
  if (const Status valid = validate(one.config); !valid) {
    return finish(run, BenchmarkState::kNotPossible, valid.error().message);
  }
  const Expected<KittiSequence> sequence =
      KittiSequence::open(one.sequence_dir, {.camera = one.config.input.camera});
  if (!sequence) {
    return finish(run, BenchmarkState::kFailed, sequence.error().message);
  }
  if (run.protocol == ScaleProtocol::kGroundTruthSteps && !sequence->ground_truth()) {
    return finish(run, BenchmarkState::kNotPossible, "no ground truth");
  }
  const Expected<Fingerprint> now =
      make_fingerprint(one.config, *sequence, one.sequence_dir, request.models_dir);
  if (!now) {
    return finish(run, BenchmarkState::kFailed, now.error().message);
  }
  std::string note;
  run.report = kept_report(one.out_dir, *now, note);
  if (run.report) {
    return finish(run, BenchmarkState::kKept);
  }
  if (!reporter.update(0, sequence->size(), note)) {
    return;
  }
  one.started = std::chrono::steady_clock::now();
  run_now(one, *now, reporter, run);
}

}  // namespace stemvo::benchmark
