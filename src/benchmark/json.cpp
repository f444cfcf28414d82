// SPDX-License-Identifier: MIT
#include <nlohmann/json.hpp>

#include "benchmark/files.hpp"
#include "benchmark/names.hpp"
#include "benchmark/published.hpp"
#include "report/metrics_keys.hpp"
#include "report/optional_number.hpp"

namespace stemvo::benchmark {
namespace {

using Json = nlohmann::ordered_json;

std::string_view word_for(BenchmarkState state) {
  switch (state) {
    case BenchmarkState::kPending:
      return "pending";
    case BenchmarkState::kDone:
    case BenchmarkState::kKept:  // an interrupt and a second call leave no trace
      return "done";
    case BenchmarkState::kNotPossible:
      return "not possible";
    case BenchmarkState::kFailed:
      return "failed";
  }
  return "failed";
}

Json text_or_null(std::string_view text) { return text.empty() ? Json() : Json(text); }

Json run_json(const BenchmarkRun& run) {
  Json json;
  json["configuration"] = run.configuration;
  json["scale_source"] = to_string(run.protocol);
  json["alignment"] = "none";
  json["state"] = word_for(run.state);
  json["problem"] = text_or_null(run.problem);
  json["tracked_fraction"] = run.report ? Json(run.report->tracked_fraction) : Json();
  add_metrics(json, run.report && run.report->metrics ? &*run.report->metrics : nullptr);
  return json;
}

Json published_json(const PublishedNumbers& published) {
  Json json;
  json["method"] = published.method;
  json["scale_source"] = published.scale;
  json["alignment"] = published.alignment;
  json["t_rel_percent"] = number_or_null(published.t_rel_percent);
  json["r_rel_deg_per_100m"] = number_or_null(published.r_rel_deg_per_100m);
  json["average_offset_m"] = number_or_null(published.average_offset_m);
  json["ate_rmse_m"] = number_or_null(published.ate_rmse_m);
  json["source"] = published.source;
  return json;
}

Json sequence_json(const BenchmarkSequence& sequence) {
  Json json;
  json["name"] = sequence.name;
  json["problem"] = text_or_null(sequence.problem);
  json["first_frame"] = sequence.frames.begin;
  json["frames"] = sequence.frames.end - sequence.frames.begin;
  json["official_frames"] = sequence.official_frames ? Json(*sequence.official_frames) : Json();
  json["is_complete"] = sequence.is_complete;
  json["runs"] = Json::array();
  for (const BenchmarkRun& run : sequence.runs) {
    json["runs"].push_back(run_json(run));
  }
  const Metrics* metrics = any_metrics(sequence);
  json["never_moving"]["average_offset_m"] =
      metrics != nullptr ? Json(metrics->null_offset_m) : Json();
  json["published"] = Json::array();
  if (sequence.is_complete) {
    for (const PublishedNumbers& published : published_numbers(sequence.name)) {
      json["published"].push_back(published_json(published));
    }
  }
  return json;
}

}  // namespace

std::string format_json(const BenchmarkReport& report) {
  Json json;
  json["stemvo_version"] = report.stemvo_version;
  json["interrupted"] = report.interrupted;
  json["sequences"] = Json::array();
  for (const BenchmarkSequence& sequence : report.sequences) {
    json["sequences"].push_back(sequence_json(sequence));
  }
  return to_text(json);
}

std::string format_speed_json(const BenchmarkReport& report) {
  Json json = Json::array();
  for (const BenchmarkSequence& sequence : report.sequences) {
    for (const BenchmarkRun& run : sequence.runs) {
      if (run.report) {
        json.push_back({{"sequence", sequence.name},
                        {"configuration", run.configuration},
                        {"scale_source", to_string(run.protocol)},
                        {"fps", run.report->fps}});
      }
    }
  }
  return to_text(json);
}

}  // namespace stemvo::benchmark
