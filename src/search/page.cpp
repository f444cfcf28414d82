// SPDX-License-Identifier: MIT
// report.html of a search.
#include "html/page.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "html/figures.hpp"
#include "search/records.hpp"

namespace stemvo::search {
namespace {

using nlohmann::json;

using Number = std::optional<double>;

/// What a filter's point says when it is hovered over.
std::string described(const FilterRow& row) {
  const auto part = [](const char* name, const Number& value, const char* unit) {
    return value ? fmt::format("\n{} {:.3g} {}", name, *value, unit) : std::string();
  };
  return to_string(row.key) + part("t_rel", row.mean.t_rel_percent, "%") +
         part("r_rel", row.mean.r_rel_deg_per_100m, "deg/100 m") +
         part("inliers", row.mean.inliers, "") + part("tracked", row.mean.tracked, "of the frames");
}

/// Points of the rows that have both numbers, a trace for each thing that became of them.
template <typename X, typename Y>
json traces_of(const Results& results, const X& x_of, const Y& y_of, bool has_bars = false) {
  json groups = json::array();
  for (const char* name : {has_intervals(results.rows) ? "equal to the best" : "filter",
                           "worse than the best", "baseline", "stopped early"}) {
    groups.push_back(
        {{"name", name}, {"mode", "markers"}, {"marker", {{"size", 8}}}, {"hoverinfo", "text"}});
    if (has_bars) {
      groups.back()["error_y"] = {{"type", "data"}, {"symmetric", false}, {"thickness", 1}};
    }
  }
  for (const FilterRow& row : results.rows) {
    const Number x = x_of(row);
    const Number y = y_of(row);
    if (row.status == FilterStatus::kNotDetected || !x || !y) {
      continue;
    }
    json& group = groups[results.identity.layer_of(row.key).baseline ? 2
                         : row.status == FilterStatus::kStopped      ? 3
                         : row.is_equal                              ? 0
                                                                     : 1];
    group["x"].push_back(*x);
    group["y"].push_back(*y);
    group["text"].push_back(described(row));
    if (has_bars) {
      const ErrorRatio& over = row.over_best;
      const bool is_known = std::isfinite(over.high);
      group["error_y"]["array"].push_back(is_known ? over.high - over.ratio : 0.0);
      group["error_y"]["arrayminus"].push_back(is_known ? over.ratio - over.low : 0.0);
    }
  }
  json traces = json::array();
  std::ranges::copy_if(groups, std::back_inserter(traces),
                       [](const json& group) { return group.contains("x"); });
  return traces;
}

void add_ranking(const Results& results, html::Page& page) {
  int rank = 0;
  const bool has_bars = has_intervals(results.rows);
  const json traces = traces_of(
      results,
      [&](const FilterRow& row) {
        return row.status == FilterStatus::kRanked ? Number(++rank) : std::nullopt;
      },
      [](const FilterRow& row) { return Number(row.over_best.ratio); }, has_bars);
  const json layout = {{"xaxis", html::titled("rank")},
                       {"yaxis", html::logarithmic("error, times the best's")}};
  page.add_figure(
      {"Filters by rank",
       has_bars
           ? "Bars are 95 % intervals; filters whose bar holds 1 cannot be told from the best."
           : "The path is too short for 95 % intervals, which say what is worse than the best.",
       traces, layout});
}

void add_scatter(const Results& results, html::Page& page) {
  const auto t_rel = [](const FilterRow& row) { return row.mean.t_rel_percent; };
  json layout = {{"xaxis", html::titled("inliers per frame")},
                 {"yaxis", html::titled("t_rel, %", 2)}};
  page.add_figure(
      {"Error and matches", "Of filters stopped early: over the frames they ran.",
       traces_of(results, [](const FilterRow& row) { return row.mean.inliers; }, t_rel), layout});
  if (!results.identity.sequences.back().held_out) {
    return;
  }
  const auto held_out = [](const FilterRow& row) {
    return row.held_out && row.held_out->detected ? row.held_out->t_rel_percent : std::nullopt;
  };
  layout = {{"xaxis", html::titled("t_rel, %", 2)}, {"yaxis", html::titled("t_rel held out, %")}};
  page.add_figure(
      {"On the sequence that did not rank", "", traces_of(results, t_rel, held_out), layout});
}

void add_paths(const Results& results, const Trajectory& ground_truth, html::Page& page) {
  std::vector<html::PathFromAbove> paths = {
      {"ground truth", html::seen_from_above(ground_truth), true}};
  for (const auto& [rank, row] : choose_rows(results.identity, results.rows)) {
    paths.push_back({fmt::format("{}: {}", rank, to_string(row->key)),
                     row->drives.front().path_xz_m, false,
                     results.identity.layer_of(row->key).baseline});
  }
  html::add_paths_from_above(
      page, "Paths from above",
      fmt::format("Of {}, each step of its true length.", results.identity.sequences.front().name),
      paths);
}

std::string subtitle_of(const Results& results) {
  std::string names;
  for (const SequenceIdentity& sequence : results.identity.sequences) {
    names +=
        fmt::format("{}{} {}:{}{}", names.empty() ? "" : ", ", sequence.name, sequence.first_frame,
                    sequence.end_frame(), sequence.held_out ? " (held out)" : "");
  }
  const bool is_behind =
      !results.rows.empty() && results.identity.layer_of(results.rows.front().key).baseline;
  return fmt::format(
      "{} rows; frames {}; {}{}", results.rows.size(), names,
      results.identity.rungs.size() == 1 ? "every filter over every frame" : "successive halving",
      is_behind ? "; the baseline " + to_string(results.rows.front().key) + " ranks before it"
                : "");
}

}  // namespace

Status write_page(const Results& results, const Pictures& pictures, const std::string& table) {
  const ShownFilters shown = choose_rows(results.identity, results.rows);
  html::Page page(shown.empty() ? "Search" : "Best filter: " + to_string(shown.front().second->key),
                  subtitle_of(results));
  add_ranking(results, page);
  add_scatter(results, page);
  if (pictures.ground_truth) {
    add_paths(results, *pictures.ground_truth, page);
  }
  if (!pictures.channels.empty()) {
    page.add_images("Channels", pictures.channels);
  }
  page.add_text("All filters", table);
  html::add_how_to_repeat(page, results.target.command, "Configuration of all rows",
                          results.identity.configuration);
  return page.write(results.target.out_dir / "report.html");
}

}  // namespace stemvo::search
