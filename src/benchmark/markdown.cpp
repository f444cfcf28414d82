// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "benchmark/benchmark.hpp"
#include "text/text_table.hpp"

namespace stemvo::benchmark {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kHead =
    R"(# Benchmark

stemvo {}. t_rel in %, r_rel in degrees per 100 m (KITTI devkit), offset in m (mean of |dx| + |dz|). Nothing is aligned, except in the
column ATE (root mean square position error in m after Sim(3)) and where a published row says so. *Camera height*: metres from the road and the
camera's height above it, no ground truth. *Per-step ground-truth scale*: each step takes its true length (the paper's protocol), so direction and rotation are
judged, scale is not. *Zero motion*: what a trajectory scores that stays at the start.
)";

/// Names come from folders: nothing in them may end a cell or a line.
std::string safe(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '|') {
      result += '\\';
    }
    result += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return result;
}

std::string number(const Json& value, int decimals) {
  return value.is_number() && std::isfinite(value.get<double>())
             ? fmt::format("{:.{}f}", value.get<double>(), decimals)
             : "-";
}

using Cells = std::vector<std::string>;

std::string row(const Cells& cells) { return fmt::format("| {} |\n", fmt::join(cells, " | ")); }

std::string head_row(const Cells& cells) {
  return row(cells) + fmt::format("|{}\n", fmt::join(Cells(cells.size(), "---|"), ""));
}

/// For people: "camera height", "per-step ground-truth scale".
std::string words_for(const Json& scale_source) {
  return scale_source == "camera_height" ? "camera height" : "per-step ground-truth scale";
}

bool has_metrics(const Json& run) { return !run["segments"].is_null(); }

/// t_rel, r_rel and offset.
std::vector<std::string> errors(const Json& numbers, int r_rel_decimals) {
  return {number(numbers["t_rel_percent"], 2),
          number(numbers["r_rel_deg_per_100m"], r_rel_decimals),
          number(numbers["average_offset_m"], 2)};
}

/// The cell of a run in the table over all sequences.
std::string short_cell(const Json& run) {
  return has_metrics(run)            ? fmt::format("{}", fmt::join(errors(run, 2), " / "))
         : run["state"] == "pending" ? "not run yet"
         : run["state"] == "failed"  ? "failed"
                                     : "-";
}

/// A column per sequence that could be read; all have the same runs.
std::string overview(const Json& report) {
  std::vector<Cells> rows = {{""}, {"t_rel / r_rel / offset"}};
  Cells baseline = {"zero motion"};
  for (const Json& sequence : report["sequences"]) {
    if (!sequence["problem"].is_null()) {
      continue;
    }
    rows[0].push_back(safe(sequence["name"]));
    rows[1].push_back(describe_frames(sequence));
    rows.resize(2 + sequence["runs"].size());
    for (std::size_t i = 2; i < rows.size(); ++i) {
      const Json& run = sequence["runs"][i - 2];
      if (rows[i].empty()) {
        rows[i] = {safe(name_of(run))};
      }
      rows[i].push_back(short_cell(run));
    }
    const Json& offset_m = sequence["zero_motion"]["average_offset_m"];
    baseline.push_back(offset_m.is_null() ? "-" : "- / - / " + number(offset_m, 2));
  }
  if (baseline.size() == 1) {
    return {};
  }
  std::string text = "\n## All sequences\n\n" + head_row(rows[0]);
  rows.push_back(baseline);
  std::for_each(rows.begin() + 1, rows.end(), [&](const Cells& cells) { text += row(cells); });
  return text;
}

std::string explain(const Json& run) {
  return !run["problem"].is_null()   ? safe(run["problem"])
         : run["state"] == "pending" ? "not run yet"
                                     : fmt::format("{:.1f} % of the frames measured{}",
                                                   100.0 * run["tracked_fraction"].get<double>(),
                                                   has_metrics(run) ? "" : "; no ground truth");
}

/// A run's, or a published one's.
std::string result_row(const Json& result, bool is_published) {
  const Json& ate = result["ate_rmse_m"];
  return row(
      {safe(result[is_published ? "method" : "configuration"]),
       is_published ? std::string(result["scale_source"]) : words_for(result["scale_source"]),
       is_published ? std::string(result["alignment"]) : "none",
       fmt::format("{}", fmt::join(errors(result, is_published ? 2 : 3), " | ")),
       number(ate.is_object() ? ate["sim3"] : ate, 2),
       is_published ? "published: " + std::string(result["source"]) : explain(result)});
}

std::string section(const Json& sequence) {
  std::string text = fmt::format("\n## {}\n\n", safe(sequence["name"]));
  if (!sequence["problem"].is_null()) {
    return text + fmt::format("Not run: {}\n", safe(sequence["problem"]));
  }
  text += describe_frames(sequence);
  const Json& runs = sequence["runs"];
  const auto any = std::find_if(runs.begin(), runs.end(), has_metrics);
  if (any != runs.end()) {
    text += fmt::format(", {:.0f} m; {} segments of {}", (*any)["path_length_m"].get<double>(),
                        (*any)["segments"].get<int>(), length_range((*any)["segment_lengths_m"]));
  }
  text +=
      ".\n\n" + head_row({"", "scale from", "alignment", "t_rel", "r_rel", "offset", "ATE", ""});
  for (const Json& run : runs) {
    text += result_row(run, false);
  }
  if (any != runs.end()) {
    text +=
        row({"zero motion", "-", "none", "-", "-", number((*any)["null_offset_m"], 2), "-", ""});
  }
  for (const Json& numbers : sequence["published"]) {
    text += result_row(numbers, true);
  }
  if (sequence["published"].empty() && !sequence["official_frames"].is_null()) {
    text += "\nPublished numbers are of all official frames, and stand here when those ran.\n";
  }
  return text;
}

}  // namespace

std::string name_of(const Json& run) {
  return run["configuration"].get<std::string>() + ", " + words_for(run["scale_source"]);
}

std::string describe_frames(const Json& sequence) {
  const auto begin = sequence["first_frame"].get<std::size_t>();
  const auto num_frames = sequence["frames"].get<std::size_t>();
  if (sequence["is_complete"] == true) {
    return fmt::format("all {} frames", num_frames);
  }
  const Json& official = sequence["official_frames"];
  return official.is_null()
             ? fmt::format("frames {}:{}", begin, begin + num_frames)
             : fmt::format("clip {}:{} of {}", begin, begin + num_frames, official.dump());
}

std::string format_markdown(const Json& report) {
  std::string text = fmt::format(fmt::runtime(kHead), report["stemvo_version"].get<std::string>()) +
                     overview(report);
  for (const Json& sequence : report["sequences"]) {
    text += section(sequence);
  }
  return text;
}

}  // namespace stemvo::benchmark
