// SPDX-License-Identifier: MIT
// report.html of a search.
#include "html/page.hpp"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "html/figures.hpp"
#include "io/image_file.hpp"
#include "search/records.hpp"

namespace stemvo::search {
namespace {

using nlohmann::json;

json number(const std::optional<double>& value) { return value ? json(*value) : json(); }

/// What a filter's points say when they are hovered over.
std::string described(const FilterRow& row) {
  const auto part = [](const char* name, const std::optional<double>& value, const char* unit) {
    return value ? fmt::format("\n{} {:.3g} {}", name, *value, unit) : std::string();
  };
  return to_string(row.key) + part("t_rel", row.mean.t_rel_percent, "%") +
         part("r_rel", row.mean.r_rel_deg_per_100m, "deg/100 m") +
         part("inliers", row.mean.inliers, "") + part("tracked", row.mean.tracked, "of the frames");
}

/// Points of rows, in traces by what became of them.
class Groups {
 public:
  explicit Groups(const Results& results) : results_(results) {}

  template <typename X, typename Y>
  [[nodiscard]] json traces(const X& x_of, const Y& y_of, bool has_intervals) const {
    std::vector<json> groups = {trace("equal to the best"), trace("worse than the best"),
                                trace("baseline"), trace("stopped early")};
    for (const FilterRow& row : results_.rows) {
      const json x = x_of(row);
      const json y = y_of(row);
      if (row.status == FilterStatus::kNotDetected || x.is_null() || y.is_null()) {
        continue;
      }
      json& group = groups[group_of(row)];
      group["x"].push_back(x);
      group["y"].push_back(y);
      group["text"].push_back(described(row));
      const bool is_known = std::isfinite(row.over_best.high);
      const double ratio = row.over_best.ratio;
      group["error_y"]["array"].push_back(is_known ? row.over_best.high - ratio : 0.0);
      group["error_y"]["arrayminus"].push_back(is_known ? ratio - row.over_best.low : 0.0);
    }
    json all = json::array();
    for (json& group : groups) {
      if (!has_intervals) {
        group.erase("error_y");
      }
      if (!group["x"].empty()) {
        all.push_back(std::move(group));
      }
    }
    return all;
  }

 private:
  static json trace(const char* name) {
    return {{"name", name},
            {"mode", "markers"},
            {"marker", {{"size", 8}}},
            {"hoverinfo", "text"},
            {"x", json::array()},
            {"y", json::array()},
            {"text", json::array()},
            {"error_y",
             {{"type", "data"},
              {"symmetric", false},
              {"thickness", 1},
              {"array", json::array()},
              {"arrayminus", json::array()}}}};
  }
  [[nodiscard]] std::size_t group_of(const FilterRow& row) const {
    if (results_.identity.layer_of(row.key).baseline) {
      return 2;
    }
    return row.status == FilterStatus::kStopped ? 3 : row.is_equal ? 0 : 1;
  }

  const Results& results_;
};

void add_ranking(const Results& results, html::Page& page) {
  std::size_t rank = 0;
  const json traces = Groups(results).traces(
      [&](const FilterRow& row) {
        return row.status == FilterStatus::kRanked ? json(++rank) : json();
      },
      [](const FilterRow& row) { return json(row.over_best.ratio); }, true);
  const json layout = {{"xaxis", html::titled("rank")},
                       {"yaxis", html::logarithmic("error, times the best's")}};
  page.add_figure(
      {"Filters by rank",
       "Bars are 95 % intervals; filters whose bar holds 1 cannot be told from the best.", traces,
       layout});
}

void add_scatter(const Results& results, html::Page& page) {
  const auto t_rel = [](const FilterRow& row) { return number(row.mean.t_rel_percent); };
  json layout = {{"xaxis", html::titled("inliers per frame")}, {"yaxis", html::titled("t_rel, %")}};
  const json traces = Groups(results).traces(
      [](const FilterRow& row) { return number(row.mean.inliers); }, t_rel, false);
  page.add_figure(
      {"Error and matches", "Of filters stopped early: over the frames they ran.", traces, layout});
  if (!results.identity.sequences.back().held_out) {
    return;
  }
  const json seen = Groups(results).traces(
      t_rel,
      [](const FilterRow& row) {
        return row.held_out && row.held_out->detected ? number(row.held_out->t_rel_percent)
                                                      : json();
      },
      false);
  layout = {{"xaxis", html::titled("t_rel, %")}, {"yaxis", html::titled("t_rel held out, %")}};
  page.add_figure({"On the sequence that did not rank", "", seen, layout});
}

void add_paths(const Results& results, const Trajectory& ground_truth, html::Page& page) {
  std::vector<html::PathFromAbove> paths = {{"ground truth", {}, true}};
  for (const Rigid3& pose : ground_truth) {
    paths.front().xz_m.push_back({pose.translation.x(), pose.translation.z()});
  }
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
  return fmt::format(
      "{} rows; frames {}; {}", results.rows.size(), names,
      results.identity.rungs.size() == 1 ? "every filter over every frame" : "successive halving");
}

}  // namespace

Status write_page(const Results& results, const Pictures& pictures, const PageTexts& texts) {
  const bool has_best =
      !results.rows.empty() && results.rows.front().status == FilterStatus::kRanked;
  html::Page page(
      has_best ? "Best filter: " + to_string(results.rows.front().key) : std::string("Search"),
      subtitle_of(results));
  add_ranking(results, page);
  add_scatter(results, page);
  if (pictures.ground_truth) {
    add_paths(results, *pictures.ground_truth, page);
  }
  if (!pictures.sheet.empty()) {
    constexpr int kQuality = 90;
    page.add_images("Channels", {{"the input, and the filters above on its middle frame",
                                  io::encode_jpeg(pictures.sheet, kQuality)}});
  }
  page.add_text("All filters", texts.table);
  html::add_how_to_repeat(page, texts.command, "Configuration of all rows",
                          results.identity.configuration);
  return page.write(results.out_dir / "report.html");
}

}  // namespace stemvo::search
