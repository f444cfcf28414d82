// SPDX-License-Identifier: MIT
#include "html/figures.hpp"

#include <cmath>

#include <nlohmann/json.hpp>

namespace stemvo::html {
namespace {

using nlohmann::json;

/// Millimetres: nobody needs a file of digits.
json rounded(double value_m) {
  return std::isfinite(value_m) ? json(std::round(value_m * 1e3) / 1e3) : json();
}

}  // namespace

json titled(const std::string& title) { return {{"title", {{"text", title}}}}; }

json logarithmic(const std::string& title) {
  json axis = titled(title);
  axis["type"] = "log";
  axis["tickformat"] = "~g";
  axis["dtick"] = "D2";  // 1, 2, 5, 10, ..
  return axis;
}

void add_paths_from_above(Page& page,
                          const std::string& heading,
                          const std::string& note,
                          const std::vector<PathFromAbove>& paths) {
  json traces = json::array();
  for (const PathFromAbove& path : paths) {
    json x = json::array();
    json y = json::array();
    for (const auto& [x_m, z_m] : path.xz_m) {
      x.push_back(rounded(x_m));
      y.push_back(rounded(z_m));
    }
    traces.push_back({{"name", path.name}, {"mode", "lines"}, {"x", x}, {"y", y}});
    traces.back()["line"] =
        path.is_ground_truth ? json{{"width", 5}, {"color", "#999999"}} : json{{"width", 2}};
    if (path.is_dotted) {
      traces.back()["line"]["dash"] = "dot";
    }
  }
  json layout = {{"large", true},
                 {"dragmode", "pan"},
                 {"xaxis", titled("x (right), m")},
                 {"yaxis", titled("z (forward), m")}};
  layout["yaxis"]["scaleanchor"] = "x";
  page.add_figure({heading, note, traces, layout});
}

void add_how_to_repeat(Page& page,
                       const std::string& command,
                       const std::string& heading,
                       const std::string& configuration) {
  if (!command.empty()) {
    page.add_text("Command", command);
  }
  page.add_folded_text(heading, configuration);
}

}  // namespace stemvo::html
