// SPDX-License-Identifier: MIT
#include "html/page.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "html/figures.hpp"
#include "robustness/robustness.hpp"

namespace stemvo::robustness {
namespace {

using nlohmann::json;

std::string label_of(const Row& row) {
  return row.disturbance == kUndisturbed ? "as the frames are"
                                         : fmt::format("{} {:g}", row.disturbance, row.strength);
}

/// The judged channel's rotation error over each control's, a row per disturbance and strength.
void add_ratios(const RobustnessReport& report, html::Page& page) {
  json traces = json::array();
  for (std::size_t control = 1; control < report.contenders.size(); ++control) {
    json x = json::array();
    json y = json::array();
    json above = json::array();
    json below = json::array();
    for (const Row& row : report.rows) {
      const ErrorRatio& found = row.verdicts[control - 1].rotation;
      if (std::isfinite(found.high) && found.low > 0.0) {
        x.push_back(found.ratio);
        y.push_back(label_of(row));
        above.push_back(found.high - found.ratio);
        below.push_back(found.ratio - found.low);
      }
    }
    traces.push_back({{"name", report.contenders[control]},
                      {"mode", "markers"},
                      {"x", x},
                      {"y", y},
                      {"error_x",
                       {{"type", "data"},
                        {"symmetric", false},
                        {"thickness", 1},
                        {"array", above},
                        {"arrayminus", below}}}});
    if (control > 1) {
      traces.back()["visible"] = "legendonly";
    }
  }
  json layout = {{"plot_height", 19 * report.rows.size()},
                 {"dragmode", "pan"},
                 {"xaxis", html::logarithmic("error, times the control's")},
                 {"yaxis", {{"autorange", "reversed"}, {"dtick", 1}}}};
  layout["shapes"] = json::array({{{"type", "line"},
                                   {"yref", "paper"},
                                   {"x0", 1},
                                   {"x1", 1},
                                   {"y0", 0},
                                   {"y1", 1},
                                   {"line", {{"width", 1}, {"color", "#999999"}}}}});
  page.add_figure({"Against the controls",
                   report.contenders.front() +
                       " is better left of 1. Bars are 95 % intervals; where one holds 1 the two "
                       "cannot be told apart. Choose controls in the legend.",
                   traces, layout});
}

/// Error over strength of one disturbance: its rows, after the undisturbed one where there is one.
void add_panel(const RobustnessReport& report,
               const std::vector<const Row*>& rows,
               html::Page& page) {
  json traces = json::array();
  for (std::size_t one = 0; one < report.contenders.size(); ++one) {
    json x = json::array();
    json y = json::array();
    for (const Row* row : rows) {
      x.push_back(row->disturbance == kUndisturbed ? kUndisturbed
                                                   : fmt::format("{:g}", row->strength));
      const auto error = mean_rotation_error(row->outcomes[one]);
      y.push_back(error ? json(*error) : json());
    }
    traces.push_back({{"name", report.contenders[one]},
                      {"mode", "lines+markers"},
                      {"line", {{"width", one == 0 ? 4 : 2}}},
                      {"x", x},
                      {"y", y}});
  }
  json layout = {{"small", true}, {"yaxis", html::logarithmic("degrees per 100 m")}};
  layout["xaxis"]["type"] = "category";
  page.add_figure(
      {rows.back()->disturbance == kUndisturbed ? "as the frames are" : rows.back()->disturbance,
       "", traces, layout});
}

/// One per disturbance, each after the undisturbed frames; those alone only where there is no
/// other.
void add_panels(const RobustnessReport& report, html::Page& page) {
  std::vector<std::string> names;
  for (const Row& row : report.rows) {
    if (std::ranges::find(names, row.disturbance) == names.end()) {
      names.push_back(row.disturbance);
    }
  }
  for (const std::string& name : names) {
    std::vector<const Row*> panel;
    for (const Row& row : report.rows) {
      if (row.disturbance == kUndisturbed || row.disturbance == name) {
        panel.push_back(&row);
      }
    }
    if (name != kUndisturbed || names.size() == 1) {
      add_panel(report, panel, page);
    }
  }
}

}  // namespace

Status write_page(const std::filesystem::path& file,
                  const RobustnessReport& report,
                  const RobustnessRequest& request) {
  html::Page page(fmt::format("Robustness of {}", report.contenders.front()),
                  fmt::format("drives {}; rotation errors r_rel", fmt::join(report.drives, ", ")));
  if (report.contenders.size() > 1) {
    add_ratios(report, page);
  }
  add_panels(report, page);
  page.add_folded_text("All numbers", format_table(report));
  html::add_how_to_repeat(page, request.command, "Configuration of the judged channel",
                          dump_config(request.config));
  return page.write(file);
}

}  // namespace stemvo::robustness
