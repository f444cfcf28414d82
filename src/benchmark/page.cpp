// SPDX-License-Identifier: MIT
// report.html of a benchmark.
#include "html/page.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmark/benchmark.hpp"

namespace stemvo::benchmark {
namespace {

using nlohmann::json;
using Json = nlohmann::ordered_json;

std::string string_of(const Json& value) { return value.get<std::string>(); }

/// One measure of every sequence, a bar per run; published numbers beside them.
void add_bars(const Json& report, const char* key, const std::string& title, html::Page& page) {
  std::vector<std::string> order;
  json bars = json::object();
  std::size_t num_bars = 0;
  const auto add = [&](const std::string& name, const Json& sequence, const Json& value) {
    if (!value.is_number()) {
      return;
    }
    if (!bars.contains(name)) {
      order.push_back(name);
      bars[name] = {{"name", name},
                    {"type", "bar"},
                    {"orientation", "h"},
                    {"x", json::array()},
                    {"y", json::array()}};
    }
    bars[name]["y"].push_back(string_of(sequence["name"]) + ", " + describe_frames(sequence));
    bars[name]["x"].push_back(value.get<double>());
    ++num_bars;
  };
  for (const Json& sequence : report["sequences"]) {
    for (const Json& run : sequence["runs"]) {
      add(name_of(run), sequence, run.value(key, Json()));
    }
    for (const Json& row : sequence["published"]) {
      add(row.value("method", std::string("published")), sequence, row.value(key, Json()));
    }
  }
  json traces = json::array();
  for (const std::string& name : order) {
    traces.push_back(bars[name]);
  }
  if (!traces.empty()) {
    const json layout = {{"plot_height", 60 + 22 * num_bars},
                         {"xaxis", html::logarithmic(title)},
                         {"yaxis", {{"type", "category"}, {"autorange", "reversed"}}}};
    page.add_figure({title, "", traces, layout});
  }
}

}  // namespace

Status write_page(const std::filesystem::path& file,
                  const nlohmann::ordered_json& report,
                  const SequencePaths& paths,
                  const BenchmarkRequest& request) {
  html::Page page("Benchmark", fmt::format("stemvo {}{}", string_of(report["stemvo_version"]),
                                           report["interrupted"] == true ? ", interrupted" : ""));
  add_bars(report, "t_rel_percent", "t_rel, %", page);
  add_bars(report, "r_rel_deg_per_100m", "r_rel, deg/100 m", page);
  for (const Json& sequence : report["sequences"]) {
    if (const auto found = paths.find(string_of(sequence["name"])); found != paths.end()) {
      html::add_paths_from_above(page,
                                 fmt::format("{}, {}", found->first, describe_frames(sequence)),
                                 "Nothing is aligned afterwards.", found->second);
    }
  }
  page.add_folded_text("All numbers", format_markdown(report));
  std::string configurations;
  for (const auto& [name, config] : request.configurations) {
    configurations +=
        fmt::format("{}# {}\n{}", configurations.empty() ? "" : "\n", name, dump_config(config));
  }
  html::add_how_to_repeat(page, request.command, "Configurations", configurations);
  return page.write(file);
}

}  // namespace stemvo::benchmark
