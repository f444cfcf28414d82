// SPDX-License-Identifier: MIT
#include "stemvo/report/timing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "report/text_table.hpp"
#include "report/timing_json.hpp"

namespace stemvo {
namespace {

double nearest_rank(std::vector<double>& values, double share) {
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
  const auto place =
      values.begin() + static_cast<std::ptrdiff_t>(std::max<std::size_t>(rank, 1)) - 1;
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

double share_percent(double seconds, const TimingReport& report) {
  return 100.0 * seconds / report.cpu_s;
}

double loop_fps(const TimingReport& report) {
  return static_cast<double>(report.num_frames) / report.loop_s;
}

void add_row(TextTable& table, const TimingReport& report, const std::string& name, double cpu_s) {
  table.add({name, "", "", "",
             fmt::format("{:.3f}", 1e3 * cpu_s / static_cast<double>(report.num_frames)),
             fmt::format("{:.1f}", share_percent(cpu_s, report))});
}

nlohmann::ordered_json to_json(const TimeSummary& summary) {
  return {{"median_ms", summary.median_ms}, {"p95_ms", summary.p95_ms}};
}

}  // namespace

TimeSummary summarize_ms(std::span<const double> values_ms) {
  if (values_ms.empty()) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    return {kNaN, kNaN};
  }
  std::vector<double> values(values_ms.begin(), values_ms.end());
  return {nearest_rank(values, 0.5), nearest_rank(values, 0.95)};
}

std::string format_timing_table(const TimingReport& report) {
  TextTable table("lrrrrr");
  table.add({"stage", "calls", "median ms", "p95 ms", "CPU ms/frame", "share %"});
  table.rule();
  for (const StageTiming& stage : report.stages) {
    table.add({stage.name, fmt::format("{}", stage.calls),
               fmt::format("{:.3f}", stage.wall.median_ms),
               fmt::format("{:.3f}", stage.wall.p95_ms),
               fmt::format("{:.3f}", 1e3 * stage.cpu_s / static_cast<double>(report.num_frames)),
               fmt::format("{:.1f}", stage.share_percent)});
  }
  add_row(table, report, "start of the program", report.start_cpu_s);
  add_row(table, report, "other, and OpenCV's threads", report.rest_cpu_s);
  table.rule();
  add_row(table, report, "processor time", report.cpu_s);
  TextTable whole("lrl");
  const auto spread = [](const TimeSummary& time) {
    return fmt::format("{:.2f} ms", time.median_ms);
  };
  const auto p95 = [](const TimeSummary& time) {
    return fmt::format("p95 {:.2f} ms", time.p95_ms);
  };
  whole.add({"a frame's result every", spread(report.interval), p95(report.interval)});
  whole.add({"from frame to result", spread(report.latency), p95(report.latency)});
  whole.add({"speed, whole program", fmt::format("{:.1f} frames/s", report.fps),
             fmt::format("{} frames, {} threads", report.num_frames, report.num_threads)});
  whole.add({"speed, loop over frames", fmt::format("{:.1f} frames/s", loop_fps(report))});
  whole.add({"peak memory", fmt::format("{:.0f} MiB", report.peak_memory_mib)});
  return table.str() + '\n' + whole.str();
}

nlohmann::ordered_json timing_json(const TimingReport& report) {
  nlohmann::ordered_json json;
  json["threads"] = report.num_threads;
  json["fps"] = report.fps;
  json["loop_fps"] = loop_fps(report);
  json["interval"] = to_json(report.interval);
  json["latency"] = to_json(report.latency);
  json["peak_memory_mib"] = report.peak_memory_mib;
  json["cpu_s"] = report.cpu_s;
  json["start_cpu_s"] = report.start_cpu_s;
  json["other_cpu_s"] = report.rest_cpu_s;
  json["stages"] = nlohmann::ordered_json::object();
  for (const StageTiming& stage : report.stages) {
    nlohmann::ordered_json row = {{"calls", stage.calls}};
    row.update(to_json(stage.wall));
    row["cpu_s"] = stage.cpu_s;
    row["share_percent"] = stage.share_percent;
    json["stages"][stage.name] = row;
  }
  return json;
}

}  // namespace stemvo
