// SPDX-License-Identifier: MIT
#include "html/figures.hpp"

#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace stemvo::html {
using nlohmann::json;

json rounded(double value) {
  return std::isfinite(value) ? json(std::round(value * 1e5) / 1e5) : json();
}

json titled(const std::string& title, std::optional<int> hover_digits) {
  json axis = {{"title", {{"text", title}}}};
  if (hover_digits) {
    axis["hoverformat"] = fmt::format(".{}f", *hover_digits);
  }
  return axis;
}

json logarithmic(const std::string& title) {
  json axis = titled(title);
  axis["type"] = "log";
  axis["tickformat"] = "~g";
  return axis;
}

std::vector<std::array<double, 2>> seen_from_above(std::span<const Rigid3> poses) {
  std::vector<std::array<double, 2>> xz;
  for (const Rigid3& pose : poses) {
    xz.push_back({pose.translation.x(), pose.translation.z()});
  }
  return xz;
}

json scene_around(const std::vector<std::span<const Rigid3>>& trajectories) {
  constexpr double kMargin = 0.15;
  constexpr double kShortest = 0.45;                 // of the longest
  Eigen::AlignedBox3d box(Eigen::Vector3d::Zero());  // where they start
  for (const std::span<const Rigid3> trajectory : trajectories) {
    for (const Rigid3& pose : trajectory) {
      const Eigen::Vector3d& p = pose.translation;
      if (p.allFinite()) {
        box.extend(Eigen::Vector3d(p.x(), p.z(), -p.y()));
      }
    }
  }
  const Eigen::Vector3d sizes = box.sizes().cwiseMax(1e-3 + 1e-3 * box.sizes().maxCoeff());
  const Eigen::Vector3d lengths = (sizes / sizes.maxCoeff()).cwiseMax(kShortest);
  json scene = {{"camera", {{"eye", {{"x", -2.0}, {"y", -2.0}, {"z", 1.8}}}}}};
  for (const auto& [i, letter] : {std::pair(0, "x"), std::pair(1, "y"), std::pair(2, "z")}) {
    const double half = (0.5 + kMargin) * sizes[i];
    scene["aspectratio"][letter] = rounded(lengths[i]);
    scene[letter + std::string("axis")]["nticks"] = 5;
    scene[letter + std::string("axis")]["range"] = {rounded(box.center()[i] - half),
                                                    rounded(box.center()[i] + half)};
  }
  return scene;
}

void add_paths_from_above(Page& page,
                          const std::string& heading,
                          const std::string& note,
                          const std::vector<PathFromAbove>& paths,
                          const std::string& unit) {
  json traces = json::array();
  int frame_trace = -1;
  for (const PathFromAbove& path : paths) {
    json x = json::array();
    json y = json::array();
    for (const auto& [right, forward] : path.xz) {
      x.push_back(rounded(right));
      y.push_back(rounded(forward));
    }
    json& trace = traces.emplace_back(json{{"name", path.name}, {"mode", "lines"}});
    trace["x"] = x;
    trace["y"] = y;
    trace["line"] =
        path.is_ground_truth ? json{{"width", 5}, {"color", "#999999"}} : json{{"width", 2}};
    if (path.is_dotted) {
      trace["line"]["dash"] = "dot";
    }
    if (!path.frames.empty()) {
      frame_trace = static_cast<int>(traces.size()) - 1;
      trace.update({{"mode", "lines+markers"}, {"marker", {{"size", 4}}}, {"hoverinfo", "text"}});
      trace["text"] = path.frames;
    }
  }
  json layout = {{"large", true},
                 {"dragmode", "pan"},
                 {"xaxis", titled("x (right), " + unit, 3)},
                 {"yaxis", titled("z (forward), " + unit, 3)}};
  layout["yaxis"]["scaleanchor"] = "x";
  page.add_figure({heading, note, traces, layout, frame_trace});
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
