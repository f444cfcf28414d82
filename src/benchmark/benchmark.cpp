// SPDX-License-Identifier: MIT
#include "stemvo/benchmark/benchmark.hpp"

#include <algorithm>
#include <system_error>

#include <fmt/format.h>

#include "benchmark/files.hpp"
#include "benchmark/official.hpp"
#include "benchmark/runner.hpp"
#include "pipeline/out_folder.hpp"
#include "stemvo/check.hpp"
#include "stemvo/version.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

Expected<std::vector<std::string>> find_sequences(const BenchmarkRequest& request) {
  const fs::path folder = request.kitti_root / "sequences";
  std::vector<std::string> names;
  std::error_code code;
  fs::directory_iterator entry(folder, code);
  for (; !code && entry != fs::directory_iterator(); entry.increment(code)) {
    if (entry->is_directory(code)) {
      names.push_back(entry->path().filename().string());
    }
  }
  if (code) {
    return fail(fmt::format("{}: expected a folder of sequences, found: {}", folder.string(),
                            code.message()));
  }
  if (!request.sequences.empty()) {
    std::vector<std::string> asked;  // one that is not there is a row with its reason
    for (const std::string& name : request.sequences) {
      if (name.empty() || name == "." || name == ".." || name.find('/') != std::string::npos) {
        return fail(fmt::format("{}: expected the names of folders in it, found '{}'",
                                folder.string(), name));
      }
      if (std::find(asked.begin(), asked.end(), name) == asked.end()) {
        asked.push_back(name);
      }
    }
    return asked;
  }
  if (names.empty()) {
    return fail(fmt::format("{}: expected a folder per sequence, found none", folder.string()));
  }
  std::sort(names.begin(), names.end());
  return names;
}

BenchmarkSequence plan_sequence(const BenchmarkRequest& request, const std::string& name) {
  BenchmarkSequence result;
  result.name = name;
  const auto official = benchmark::find_official(name);
  if (official) {
    result.official_frames = official->num_frames;
  }
  const Expected<KittiSequence> sequence =
      KittiSequence::open(request.kitti_root / "sequences" / name);
  if (!sequence) {
    result.problem = sequence.error().message;
    return result;
  }
  result.frames = sequence->range();
  result.has_ground_truth = sequence->ground_truth().has_value();
  result.is_complete = official && benchmark::is_official(*official, *sequence);
  for (const BenchmarkConfiguration& configuration : request.configurations) {
    for (const ScaleProtocol protocol :
         {ScaleProtocol::kCameraHeight, ScaleProtocol::kGroundTruthSteps}) {
      BenchmarkRun run;
      run.configuration = configuration.name;
      run.protocol = protocol;
      result.runs.push_back(run);
    }
  }
  return result;
}

bool has_pending(const BenchmarkReport& report) {
  return std::any_of(report.sequences.begin(), report.sequences.end(), [](const auto& sequence) {
    return std::any_of(sequence.runs.begin(), sequence.runs.end(),
                       [](const auto& run) { return run.state == BenchmarkState::kPending; });
  });
}

const BenchmarkConfiguration& configuration_of(const BenchmarkRequest& request,
                                               const BenchmarkRun& run) {
  const auto found = std::find_if(
      request.configurations.begin(), request.configurations.end(),
      [&](const auto& configuration) { return configuration.name == run.configuration; });
  STEMVO_CHECK(found != request.configurations.end(), "each run has a configuration");
  return *found;
}

}  // namespace

std::string_view to_string(ScaleProtocol protocol) {
  return protocol == ScaleProtocol::kCameraHeight ? "camera_height" : "ground_truth";
}

bool has_failures(const BenchmarkReport& report) {
  return std::any_of(report.sequences.begin(), report.sequences.end(), [](const auto& sequence) {
    return !sequence.problem.empty() ||
           std::any_of(sequence.runs.begin(), sequence.runs.end(),
                       [](const auto& run) { return run.state == BenchmarkState::kFailed; });
  });
}

Expected<BenchmarkReport> run_benchmark(const BenchmarkRequest& request,
                                        const BenchmarkCallback& callback) {
  const Expected<std::vector<std::string>> names = find_sequences(request);
  if (!names) {
    return names.error();
  }
  if (const Status made = pipeline::create_out_folder(request.out_dir); !made) {
    return made.error();
  }
  BenchmarkReport report;
  report.stemvo_version = version();
  std::size_t num_runs = 0;
  for (const std::string& name : *names) {
    report.sequences.push_back(plan_sequence(request, name));
    num_runs += report.sequences.back().runs.size();
  }
  benchmark::Reporter reporter(callback, num_runs);
  for (BenchmarkSequence& sequence : report.sequences) {
    for (BenchmarkRun& run : sequence.runs) {
      if (!reporter.is_stopped()) {
        reporter.start(sequence.name, run);
        benchmark::complete_run(request, configuration_of(request, run), sequence.name, reporter,
                                run);
      }
    }
    // A stop after the last frame of all leaves nothing to be done.
    report.interrupted = reporter.is_stopped() && has_pending(report);
    if (const Status written = benchmark::write_files(request, report, sequence); !written) {
      return written.error();
    }
    if (report.interrupted) {
      break;
    }
  }
  return report;
}

}  // namespace stemvo
