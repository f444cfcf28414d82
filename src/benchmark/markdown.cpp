// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "benchmark/files.hpp"
#include "benchmark/names.hpp"
#include "benchmark/published.hpp"
#include "report/metrics_keys.hpp"

namespace stemvo::benchmark {
namespace {

constexpr std::string_view kHead =
    R"(# Benchmark

stemvo {}. t_rel in %, r_rel in degrees per 100 m (KITTI devkit), offset in m (mean of |dx| + |dz|). Nothing is aligned, except in the
column ATE (root mean square position error in m after Sim(3)) and where a published row says so. *Camera height*: metres from the road and the
camera's height above it, no ground truth. *True steps*: each step takes its true length (the paper's protocol), so direction and rotation are
judged, scale is not. *Never moving*: what a trajectory scores that stays at the start.
)";

/// Names come from folders: nothing in them may end a cell or a line.
std::string safe(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '|') {
      result += '\\';
    }
    result += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return result;
}

std::string number(const std::optional<double>& value, int decimals) {
  return value && std::isfinite(*value) ? fmt::format("{:.{}f}", *value, decimals) : "-";
}

std::string row(const std::vector<std::string>& cells) {
  return fmt::format("| {} |\n", fmt::join(cells, " | "));
}

std::string rule(std::size_t num_columns) {
  return fmt::format("|{}\n", fmt::join(std::vector<std::string>(num_columns, "---|"), ""));
}

std::string triple(const std::optional<double>& t_rel,
                   const std::optional<double>& r_rel,
                   const std::optional<double>& offset) {
  return fmt::format("{} / {} / {}", number(t_rel, 2), number(r_rel, 2), number(offset, 2));
}

/// The cell of a run in the table over all sequences.
std::string short_cell(const BenchmarkRun& run) {
  if (run.report && run.report->metrics) {
    const Metrics& m = *run.report->metrics;
    return triple(m.t_rel_percent, m.r_rel_deg_per_100m, m.average_offset_m);
  }
  switch (run.state) {
    case BenchmarkState::kPending:
      return "not run yet";
    case BenchmarkState::kFailed:
      return "failed";
    default:
      return "-";
  }
}

std::string overview(const BenchmarkReport& report) {
  std::vector<std::string> names = {""};
  std::vector<std::string> frames = {"t_rel / r_rel / offset"};
  std::vector<std::string> never = {"never moving"};
  std::vector<std::vector<std::string>> rows;
  for (const BenchmarkSequence& sequence : report.sequences) {
    if (!sequence.problem.empty()) {
      continue;
    }
    names.push_back(safe(sequence.name));
    frames.push_back(describe_frames(sequence));
    const Metrics* metrics = any_metrics(sequence);
    never.push_back(metrics != nullptr ? triple({}, {}, metrics->null_offset_m) : "-");
    rows.resize(sequence.runs.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (rows[i].empty()) {
        rows[i].push_back(safe(title_of(sequence.runs[i])));
      }
      rows[i].push_back(short_cell(sequence.runs[i]));
    }
  }
  if (names.size() == 1) {
    return {};
  }
  std::string text = "\n## All sequences\n\n" + row(names) + rule(names.size()) + row(frames);
  for (const auto& cells : rows) {
    text += row(cells);
  }
  return text + row(never);
}

std::string explain(const BenchmarkRun& run) {
  if (!run.problem.empty()) {
    return safe(run.problem);
  }
  if (!run.report) {
    return "not run yet";
  }
  const std::string measured =
      fmt::format("{} % of the frames measured", number(100.0 * run.report->tracked_fraction, 1));
  return run.report->metrics ? measured : measured + "; no ground truth";
}

std::string run_row(const BenchmarkRun& run) {
  std::vector<std::string> cells = {safe(run.configuration), std::string(words_for(run.protocol)),
                                    "none"};
  if (run.report && run.report->metrics) {
    const Metrics& m = *run.report->metrics;
    cells.insert(cells.end(), {number(m.t_rel_percent, 2), number(m.r_rel_deg_per_100m, 3),
                               number(m.average_offset_m, 2), number(m.ate_rmse.sim3_m, 2)});
  } else {
    cells.insert(cells.end(), 4, "-");
  }
  cells.push_back(explain(run));
  return row(cells);
}

std::string published_row(const PublishedNumbers& p) {
  return row({std::string(p.method), std::string(p.scale), std::string(p.alignment),
              number(p.t_rel_percent, 2), number(p.r_rel_deg_per_100m, 2),
              number(p.average_offset_m, 2), number(p.ate_rmse_m, 2),
              "published: " + std::string(p.source)});
}

std::string section(const BenchmarkSequence& sequence) {
  std::string text = fmt::format("\n## {}\n\n", safe(sequence.name));
  if (!sequence.problem.empty()) {
    return text + fmt::format("Not run: {}\n", safe(sequence.problem));
  }
  text += describe_frames(sequence);
  const Metrics* metrics = any_metrics(sequence);
  if (metrics != nullptr) {
    text += fmt::format(", {:.0f} m; {} segments of {}", metrics->path_length_m,
                        metrics->num_segments, length_range(*metrics));
  }
  text +=
      fmt::format(".\n\n![the map of {}](<{}.png>)\n\n", safe(sequence.name), safe(sequence.name));
  const std::vector<std::string> heads = {"",      "scale from", "alignment", "t_rel",
                                          "r_rel", "offset",     "ATE",       ""};
  text += row(heads) + rule(heads.size());
  for (const BenchmarkRun& run : sequence.runs) {
    text += run_row(run);
  }
  if (metrics != nullptr) {
    text +=
        row({"never moving", "-", "none", "-", "-", number(metrics->null_offset_m, 2), "-", ""});
  }
  if (sequence.is_complete) {
    for (const PublishedNumbers& published : published_numbers(sequence.name)) {
      text += published_row(published);
    }
  } else if (sequence.official_frames) {
    text += "\nPublished numbers are of all official frames, and stand here when those ran.\n";
  }
  return text;
}

}  // namespace

std::string format_markdown(const BenchmarkReport& report) {
  std::string text = fmt::format(fmt::runtime(kHead), report.stemvo_version) + overview(report);
  for (const BenchmarkSequence& sequence : report.sequences) {
    text += section(sequence);
  }
  return text;
}

}  // namespace stemvo::benchmark
