// SPDX-License-Identifier: MIT
#include "benchmark/benchmark.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "benchmark/kept_run.hpp"
#include "html/page.hpp"
#include "pipeline/out_folder.hpp"
#include "report/metrics_keys.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kScaleSources[] = {"camera_height", "ground_truth"};
constexpr double kLengthTolerance_m = 1.5;

/// Sequences asked for, where one that is not there is a row, or all.
Expected<std::vector<std::string>> find_sequences(const BenchmarkRequest& request) {
  const fs::path folder = request.kitti_root / "sequences";
  std::vector<std::string> names;
  std::error_code code;
  for (const std::string& name : request.sequences) {
    if (name.empty() || name == "." || name == ".." || name.find('/') != std::string::npos) {
      return fail(fmt::format("{}: expected the names of folders in it, found '{}'",
                              folder.string(), name));
    }
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      names.push_back(name);
    }
  }
  if (!names.empty()) {
    return names;
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, code)) {
    if (entry.is_directory()) {
      names.push_back(entry.path().filename().string());
    }
  }
  if (names.empty()) {
    return fail(
        fmt::format("{}: expected a folder per sequence, found: {}; give the folder above it",
                    folder.string(), code ? code.message() : "none"));
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// All official frames, at their size, along the official path: a clip, a drive rendered at another
/// size, or other frames of the same name are not.
bool is_official(const Json& official, const FrameSource& sequence) {
  const Camera& camera = sequence.camera;
  const auto& truth = sequence.ground_truth;
  return sequence.range.begin == 0 && sequence.size() == official.at("frames") &&
         camera.width_px == official.at("width_px") &&
         camera.height_px == official.at("height_px") && truth &&
         std::abs(evaluate(*truth, *truth).path_length_m - official.at("length_m").get<double>()) <=
             kLengthTolerance_m;
}

/// A row per publication that has a number for the sequence.
Json published_rows(const Json& publications, const std::string& sequence) {
  Json rows = Json::array();
  for (Json row : publications) {
    bool has_number = false;
    for (auto& [key, value] : row.items()) {
      if (value.is_object()) {
        value = Json(value.value(sequence, Json()));
        has_number = has_number || value.is_number();
      }
    }
    if (has_number) {
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

const std::string& text_of(const Json& json) { return json.get_ref<const std::string&>(); }

/// benchmark.json grows while the runs are done; the other files are made of it.
class Benchmark {
 public:
  explicit Benchmark(const BenchmarkRequest& request) : request_(request) {}

  /// A row for the sequence, with all runs to be done. Throws Json::exception where `published` is
  /// not what it should be.
  void plan(const std::string& name, const Json& published) {
    const auto opened = open_kitti(sequence_dir(name));
    const Json official = published.at("sequences").value(name, Json::object());
    const Json publications = published_rows(published.at("published"), name);
    truths_[name] = opened ? opened->ground_truth : std::nullopt;
    if (opened) {
      const auto files = pipeline::input_files(*opened, Config{});
      inputs_.insert(inputs_.end(), files.begin(), files.end());
    }
    const bool is_complete = opened && !official.empty() && is_official(official, *opened);
    if (!opened) {
      summary_.failures.push_back(fmt::format("{}: {}", name, opened.error().message));
    }
    const Json runs = opened ? pending_runs() : Json::array();
    num_runs_ += runs.size();
    report_["sequences"].push_back({{"name", name},
                                    {"problem", opened ? Json() : Json(opened.error().message)},
                                    {"first_frame", opened ? opened->range.begin : 0},
                                    {"frames", opened ? opened->size() : 0},
                                    {"official_frames", official.value("frames", Json())},
                                    {"is_complete", is_complete},
                                    {"runs", runs},
                                    {"zero_motion", {{"average_offset_m", nullptr}}},
                                    {"published", is_complete ? publications : Json::array()}});
  }

  Expected<BenchmarkSummary> run() {
    for (Json& sequence : report_["sequences"]) {
      for (std::size_t i = 0; i < sequence["runs"].size() && !summary_.interrupted; ++i) {
        complete(sequence, request_.configurations[i / 2].second, sequence["runs"][i]);
      }
      report_["interrupted"] = summary_.interrupted;
      auto paths = paths_of(sequence);
      if (!paths) {
        return paths.error();
      }
      paths_[text_of(sequence["name"])] = *std::move(paths);
      if (const Status written = write_files(); !written) {
        return written.error();
      }
      if (summary_.interrupted) {
        break;
      }
    }
    summary_.json = to_text(report_);
    return summary_;
  }

  /// Input files of the sequences in the plan.
  [[nodiscard]] const std::vector<fs::path>& inputs() const { return inputs_; }

 private:
  [[nodiscard]] fs::path sequence_dir(const std::string& name) const {
    return request_.kitti_root / "sequences" / name;
  }

  [[nodiscard]] fs::path run_dir(const Json& sequence, const Json& run) const {
    return request_.out_dir / "runs" / text_of(sequence["name"]) /
           (text_of(run["configuration"]) + "_" + text_of(run["scale_source"]));
  }

  [[nodiscard]] Json pending_runs() const {
    Json runs = Json::array();
    for (const auto& [name, config] : request_.configurations) {
      for (const char* scale_source : kScaleSources) {
        runs.push_back({{"configuration", name},
                        {"scale_source", scale_source},
                        {"alignment", "none"},
                        {"state", "pending"},
                        {"problem", nullptr},
                        {"tracked_fraction", nullptr}});
        add_metrics(runs.back(), std::nullopt);
      }
    }
    return runs;
  }

  void complete(Json& sequence, const Config& config, Json& run) {
    const std::string title =
        fmt::format("{}, {}, {}", text_of(sequence["name"]), text_of(run["configuration"]),
                    text_of(run["scale_source"]));
    ++num_begun_;
    RunRequest one;
    one.sequence_dir = sequence_dir(sequence["name"]);
    one.out_dir = run_dir(sequence, run);
    one.config = config;
    const bool takes_truth = run["scale_source"] == "ground_truth";
    one.config.scale_choice = takes_truth ? ScaleChoice::kGroundTruth : ScaleChoice::kOptions;
    one.config.scale.source = takes_truth ? ScaleSource::kNone : ScaleSource::kCameraHeight;
    one.num_threads = request_.num_threads;
    if (takes_truth && !truths_[text_of(sequence["name"])]) {
      run["state"] = "not possible";
      run["problem"] = "no ground truth";
      return;
    }
    const Expected<Json> metrics = result_of(one, title);
    if (summary_.interrupted) {  // stays pending
      return;
    }
    if (!metrics) {
      run["state"] = "failed";
      run["problem"] = metrics.error().message;
      summary_.failures.push_back(fmt::format("{}: {}", title, metrics.error().message));
      return;
    }
    add_result(*metrics, sequence, run);
  }

  void add_result(const Json& metrics, Json& sequence, Json& run) {
    run["state"] = "done";
    run["tracked_fraction"] = metrics["tracked_fraction"];
    Json keys;
    add_metrics(keys, std::nullopt);
    for (const auto& [key, null] : keys.items()) {
      run[key] = metrics[key];
    }
    if (!metrics["null_offset_m"].is_null()) {
      sequence["zero_motion"]["average_offset_m"] = metrics["null_offset_m"];
    }
    speed_.push_back({{"sequence", sequence["name"]},
                      {"configuration", run["configuration"]},
                      {"scale_source", run["scale_source"]},
                      {"fps", metrics["fps"]}});
  }

  /// The metrics of an earlier call, or of a run now, which may be stopped.
  Expected<Json> result_of(RunRequest& one, const std::string& title) {
    const Expected<Json> inputs = open_kitti(one.sequence_dir, {.camera = one.config.input.camera})
                                      .and_then([&](const FrameSource& opened) {
                                        return benchmark::hash_inputs(one, opened);
                                      });
    if (!inputs) {
      return inputs;
    }
    if (const std::optional<std::string> reason = benchmark::reason_to_run(one.out_dir, *inputs)) {
      summary_.interrupted =
          request_.on_run &&
          !request_.on_run(fmt::format("{}/{} {}{}", num_begun_, num_runs_, title, *reason));
      const Status done = summary_.interrupted ? Status() : run_now(one, *inputs, title);
      if (!done || summary_.interrupted) {
        return done ? Expected<Json>(Json()) : done.error();
      }
    }
    return read_json_object(one.out_dir / benchmark::kMetricsFile);
  }

  Status run_now(RunRequest& one, const Json& inputs, const std::string& title) {
    std::error_code ignored;
    fs::remove(one.out_dir / benchmark::kInputsFile,
               ignored);  // an interrupted run must not pass for done
    one.started = std::chrono::steady_clock::now();
    const Expected<RunSummary> done = run_sequence(one, request_.on_frame);
    if (!done || !done->written) {
      return done ? done->written.error() : done.error();
    }
    summary_.interrupted = done->interrupted;
    if (done->interrupted) {
      return {};
    }
    for (const std::string& warning : done->warnings) {
      summary_.warnings.push_back(fmt::format("{}: {}", title, warning));
    }
    return benchmark::keep_run(one.out_dir, inputs);
  }

  [[nodiscard]] Status write_files() const {
    for (const auto& [name, text] : {std::pair("benchmark.md", benchmark::format_markdown(report_)),
                                     std::pair("benchmark.json", to_text(report_)),
                                     std::pair("speed.json", to_text(speed_))}) {
      if (const Status written = write_text_file(request_.out_dir / name, text); !written) {
        return written;
      }
    }
    return benchmark::write_page(request_.out_dir / "report.html", report_, paths_, request_);
  }

  /// The ground truth, where there is one, then the runs that are done.
  [[nodiscard]] Expected<Json> paths_of(const Json& sequence) {
    Json paths = Json::array();
    const auto add = [&](const std::string& name, const Trajectory& poses) {
      paths.push_back(html::path_json(poses));
      paths.back()["name"] = name;
    };
    if (const auto& truth = truths_[text_of(sequence["name"])]) {
      add("ground truth", *truth);
    }
    for (const Json& run : sequence["runs"]) {
      if (run["state"] == "done") {
        const auto poses = read_kitti_trajectory(run_dir(sequence, run) / benchmark::kPosesFile);
        if (!poses) {
          return poses.error();
        }
        add(benchmark::name_of(run), *poses);
      }
    }
    return paths;
  }

  const BenchmarkRequest& request_;
  Json report_ = {{"stemvo_version", version()}, {"interrupted", false}};
  Json speed_ = Json::array();
  std::map<std::string, std::optional<Trajectory>> truths_;
  std::vector<fs::path> inputs_;
  benchmark::SequencePaths paths_;
  std::size_t num_runs_ = 0;
  std::size_t num_begun_ = 0;
  BenchmarkSummary summary_;
};

}  // namespace

Expected<BenchmarkSummary> run_benchmark(const BenchmarkRequest& request) {
  const Expected<std::vector<std::string>> names = find_sequences(request);
  if (!names) {
    return names.error();
  }
  const Expected<Json> published = read_json_object(request.published, /*has_comments=*/true);
  if (!published) {
    return published.error();
  }
  Benchmark benchmark(request);
  try {
    for (const std::string& name : *names) {
      benchmark.plan(name, *published);
    }
  } catch (const Json::exception& error) {
    return fail(fmt::format("{}: expected official sequences and published numbers, found: {}",
                            request.published.string(), error.what()));
  }
  const auto lock = pipeline::open_out_folder(request.out_dir, "benchmark", benchmark.inputs());
  return lock ? benchmark.run() : lock.error();
}

}  // namespace stemvo
