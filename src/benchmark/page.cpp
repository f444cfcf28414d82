// SPDX-License-Identifier: MIT
// report.html of a benchmark.
#include "html/page.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "benchmark/benchmark.hpp"

namespace stemvo::benchmark {
namespace {
using Json = nlohmann::ordered_json;
}  // namespace

Status write_page(const std::filesystem::path& file,
                  Json report,
                  const SequencePaths& paths,
                  const BenchmarkRequest& request) {
  const std::string table = format_markdown(report);
  for (Json& sequence : report["sequences"]) {
    sequence["frames_text"] = describe_frames(sequence);
    for (Json& run : sequence["runs"]) {
      run["text"] = name_of(run);
    }
    if (const auto found = paths.find(sequence["name"]); found != paths.end()) {
      sequence["paths"] = found->second;
    }
  }
  std::string configurations;
  for (const auto& [name, config] : request.configurations) {
    configurations +=
        fmt::format("{}# {}\n{}", configurations.empty() ? "" : "\n", name, dump_config(config));
  }
  return html::write_page(file, {{"page", "benchmark"},
                                 {"report", std::move(report)},
                                 {"table", table},
                                 {"command", request.command},
                                 {"configuration", configurations}});
}

}  // namespace stemvo::benchmark
