// SPDX-License-Identifier: MIT
#include "report/run_page.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "evaluation/pose_file.hpp"
#include "html/figures.hpp"
#include "internal_check.hpp"
#include "text/text_table.hpp"

namespace stemvo {
namespace {

using html::rounded;
using nlohmann::json;

/// The devkit's.
constexpr std::size_t kFirstFrameStep = 10;

/// One value per element.
template <typename Range, typename Value>
json list(const Range& range, const Value& value) {
  json values = json::array();
  for (const auto& element : range) {
    values.push_back(value(element));
  }
  return values;
}

json coordinates(const Trajectory& trajectory, int axis, double sign = 1.0) {
  return list(trajectory,
              [&](const Rigid3& pose) { return rounded(sign * pose.translation[axis]); });
}

/// Whether a homography was scored against a fundamental matrix.
bool is_scored(const FrameResult& r) { return r.homography_score + r.fundamental_score > 0.0; }

class RunFigures {
 public:
  RunFigures(const RunPage& run, html::Page& page) : run_(run), page_(page), numbers_(run.numbers) {
    if (!run.ground_truth) {
      return;
    }
    constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
    travelled_.assign(run.frames.size(), kUnknown);
    errors_.assign(run.frames.size(), Eigen::Vector3d::Constant(kUnknown));
    const auto& [truth, frames] = *run.ground_truth;
    double travelled = 0.0;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      travelled += i > 0 ? (truth[i].translation - truth[i - 1].translation).norm() : 0.0;
      travelled_[frames[i]] = travelled;
      errors_[frames[i]] = run.estimate[frames[i]].translation - truth[i].translation;
    }
  }

  /// A line of text per frame.
  [[nodiscard]] std::vector<std::string> descriptions() const {
    std::vector<std::string> lines;
    for (std::size_t i = 0; i < run_.frames.size(); ++i) {
      const FrameResult& r = run_.frames[i];
      lines.push_back(fmt::format("frame {}: {}, {} of {} tracks are inliers", run_.numbers[i],
                                  to_string(r.state), r.num_inliers, r.num_matches));
      if (run_.ground_truth && !std::isnan(travelled_[i])) {
        lines.back() += fmt::format(", {} m off after {} m", format_length(errors_[i].norm(), 2),
                                    format_length(travelled_[i], 1));
      }
    }
    return lines;
  }

  void add_top_view() const {
    std::vector<html::PathFromAbove> paths;
    if (run_.ground_truth) {
      paths.push_back({"ground truth", html::seen_from_above(run_.ground_truth->poses), true});
    }
    paths.push_back(
        {"estimate", html::seen_from_above(run_.estimate), false, false, descriptions()});
    html::add_paths_from_above(
        page_, "Path from above",
        "With a mouse: drag to move, wheel (or + and -) to zoom, double click to see all.", paths,
        run_.unit);
  }

  void add_path_in_space() const {
    const auto path = [](const char* name, const Trajectory& trajectory) {
      return json{{"name", name},
                  {"type", "scatter3d"},
                  {"mode", "lines"},
                  {"line", {{"width", 4}}},
                  {"x", coordinates(trajectory, 0)},
                  {"y", coordinates(trajectory, 2)},
                  {"z", coordinates(trajectory, 1, -1.0)}};
    };
    json traces = json::array();
    if (run_.ground_truth) {
      traces.push_back(path("ground truth", run_.ground_truth->poses));
      traces.back()["line"]["color"] = "#999999";
    }
    traces.push_back(path("estimate", run_.estimate));
    std::vector<std::span<const Rigid3>> shown = {run_.estimate};
    if (run_.ground_truth) {
      shown.emplace_back(run_.ground_truth->poses);
    }
    json scene = html::scene_around(shown);
    scene["xaxis"].update(html::titled("right, " + run_.unit, 3));
    scene["yaxis"].update(html::titled("forward, " + run_.unit, 3));
    scene["zaxis"].update(html::titled("up, " + run_.unit, 3));
    const json layout = {{"large", true}, {"scene", scene}};
    add({"Path in space", "Short axes are stretched: heights are what the ticks say.", traces,
         layout, static_cast<int>(traces.size()) - 1});
  }

  void add_errors_over_distance() const {
    const json distance = list(travelled_, rounded);
    json traces = {
        {{"name", "position"},
         {"mode", "lines"},
         {"x", distance},
         {"y", list(errors_, [](const Eigen::Vector3d& error) { return rounded(error.norm()); })},
         {"text", descriptions()},
         {"hoverinfo", "text+name"}},
        {{"name", "height, too high is above 0"},
         {"mode", "lines"},
         {"x", distance},
         {"y", list(errors_, [](const Eigen::Vector3d& error) { return rounded(-error.y()); })}}};
    if (run_.ground_truth->frames.size() < run_.frames.size()) {
      for (json& trace : traces) {
        trace.update({{"mode", "lines+markers"}, {"connectgaps", true}});
      }
    }
    add({"Error over distance",
         "",
         traces,
         {{"xaxis", html::titled("true path, m", 3)}, {"yaxis", html::titled("error, m", 3)}},
         0});
  }

  void add_errors_by_length() const {
    const auto& [truth, frames] = *run_.ground_truth;
    const auto errors = segment_errors(take_poses(run_.estimate, frames), truth,
                                       run_.report.metrics->segment_lengths_m, kFirstFrameStep);
    std::set<double> lengths;  // that fit into the drive
    for (const SegmentError& error : errors) {
      lengths.insert(error.length_m);
    }
    json each = json::array();
    for (const auto& [name, member, y_axis] :
         {std::tuple("t_rel", &SegmentError::t_percent, "y"),
          std::tuple("r_rel", &SegmentError::r_deg_per_100m, "y2")}) {
      json segments = {
          {"name", fmt::format("{} of a segment", name)},
          {"mode", "markers"},
          {"opacity", 0.4},
          {"x", list(errors, [](const SegmentError& e) { return e.length_m; })},
          {"y", list(errors, [&](const SegmentError& e) { return rounded(e.*member); })}};
      json mean = {
          {"name", fmt::format("{}, mean", name)},
          {"mode", "lines+markers"},
          {"x", lengths},
          {"y", list(lengths, [&](double length) { return mean_at(errors, length, member); })}};
      for (json* trace : {&segments, &mean}) {
        (*trace)["yaxis"] = y_axis;
        (*trace)["xaxis"] = y_axis == std::string("y") ? "x" : "x2";
        each.push_back(std::move(*trace));
      }
    }
    json layout = {{"grid", {{"rows", 1}, {"columns", 2}, {"pattern", "independent"}}},
                   {"xaxis", html::titled("segment, m")},
                   {"xaxis2", html::titled("segment, m")},
                   {"yaxis", html::titled("t_rel, %", 2)},
                   {"yaxis2", html::titled("r_rel, deg/100 m", 3)}};
    add({"Error by segment length", "KITTI's segments, from every tenth frame.", each, layout});
  }

  void add_tracks() const {
    const json traces = {
        over_frames("tracks", "y3", [](const FrameResult& r) { return r.num_matches; }),
        over_frames("inliers", "y3", [](const FrameResult& r) { return r.num_inliers; }),
        over_frames(
            "R_H", "y2",
            [](const FrameResult& r) {
              return is_scored(r) ? rounded(r.homography_ratio) : json();
            },
            "lines+markers"),
        over_frames(
            "state", "y", [](const FrameResult& r) { return to_string(r.state); }, "markers")};
    json layout = stacked(3);
    layout["yaxis3"].update(html::titled("tracks"));
    layout["yaxis2"].update(html::titled("R_H", 3));
    layout["yaxis2"]["range"] = ratio_range();
    layout["yaxis"]["type"] = "category";
    add({"Tracks, model and state",
         "R_H: score of the homography over that of both models; a map has it until it starts.",
         traces, layout, 0});
  }

  void add_scale_and_camera() const {
    json steps = json::array({nullptr});
    for (std::size_t i = 1; i < run_.estimate.size(); ++i) {
      steps.push_back(
          rounded((run_.estimate[i].translation - run_.estimate[i - 1].translation).norm()));
    }
    json traces =
        json::array({over_frames("length of a step", "y2", [](const FrameResult&) { return 0; })});
    traces[0]["y"] = steps;
    add_learnt(traces, "principal point, x", "#009e73", &Camera::cx_px, &CameraSigma::cx_px);
    add_learnt(traces, "principal point, y", "#cc79a7", &Camera::cy_px, &CameraSigma::cy_px);
    const bool is_focal_learnt = std::any_of(
        run_.frames.begin(), run_.frames.end(),
        [&](const FrameResult& r) { return r.camera.fx_px != run_.frames.front().camera.fx_px; });
    if (is_focal_learnt) {
      add_learnt(traces, "focal length", "#e69f00", &Camera::fx_px, &CameraSigma::fx_px);
    }
    const bool has_scale = std::any_of(run_.frames.begin(), run_.frames.end(),
                                       [](const FrameResult& r) { return r.scale_sigma; });
    json layout = stacked(has_scale ? 3 : 2);
    if (has_scale) {
      traces.push_back(over_frames("sigma of the scale", "y3", [](const FrameResult& r) {
        return r.scale_sigma ? rounded(100.0 * *r.scale_sigma) : json();
      }));
      layout["yaxis3"].update(html::logarithmic("sigma, %"));  // it begins with 100
      layout["yaxis3"]["hoverformat"] = ".2f";
    }
    layout["yaxis2"].update(html::titled("step, " + run_.unit, 3));
    layout["yaxis"].update(html::titled("moved by, px", 2));
    add({"Scale and camera", "Shaded: one sigma, where the camera is learnt.", traces, layout, 0});
  }

  void add_times() const {
    json traces = json::array();
    for (const auto& [name, member] :
         {std::pair("stem", &StageTimes::stem_ms), std::pair("features", &StageTimes::features_ms),
          std::pair("pose", &StageTimes::pose_ms)}) {
      traces.push_back(
          over_frames(name, "y", [&](const FrameResult& r) { return rounded(r.times.*member); }));
    }
    add({"Time per stage",
         "Stages of different frames overlap: they do not add up to a frame's time.",
         traces,
         {{"xaxis", frames_axis()}, {"yaxis", html::titled("ms", 1)}, {"hovermode", "x unified"}},
         0});
  }

 private:
  void add(const html::Figure& figure) const { page_.add_figure(figure); }

  /// How far it has moved; around it one sigma, where it has one.
  void add_learnt(json& traces,
                  const char* name,
                  const char* color,
                  double Camera::* value,
                  double CameraSigma::* sigma) const {
    const FrameResult& first = run_.frames.front();
    const auto line = [&](double sigmas) {
      json trace = over_frames(name, "y", [&](const FrameResult& r) {
        return rounded(r.camera.*value - first.camera.*value +
                       sigmas * r.camera_sigma.value_or(CameraSigma()).*sigma);
      });
      trace["line"] = {{"color", color}, {"width", sigmas == 0.0 ? 2 : 0}};
      if (sigmas != 0.0) {
        trace.update({{"showlegend", false}, {"hoverinfo", "skip"}});
      }
      return trace;
    };
    if (first.camera_sigma) {
      traces.push_back(line(-1.0));
      traces.push_back(line(1.0));
      traces.back().update({{"fill", "tonexty"}, {"fillcolor", color + std::string("40")}});
    }
    traces.push_back(line(0.0));
  }

  static json mean_at(const std::vector<SegmentError>& errors,
                      double length,
                      double SegmentError::* member) {
    double sum = 0.0;
    int count = 0;
    for (const SegmentError& error : errors) {
      sum += error.length_m == length ? error.*member : 0.0;
      count += error.length_m == length ? 1 : 0;
    }
    return count > 0 ? rounded(sum / count) : json();
  }

  template <typename Value>
  [[nodiscard]] json over_frames(const char* name,
                                 const char* y_axis,
                                 const Value& value,
                                 const char* mode = "lines") const {
    return {{"name", name},
            {"mode", mode},
            {"x", numbers_},
            {"y", list(run_.frames, value)},
            {"yaxis", y_axis}};
  }

  /// Around what there is, often one frame only, and where both models are level.
  [[nodiscard]] json ratio_range() const {
    double low = 0.4;
    double high = 0.5;
    for (const FrameResult& r : run_.frames) {
      low = is_scored(r) ? std::min(low, r.homography_ratio) : low;
      high = is_scored(r) ? std::max(high, r.homography_ratio) : high;
    }
    return {low - 0.05, high + 0.05};
  }

  /// The same in each figure.
  [[nodiscard]] json frames_axis() const {
    const auto first = static_cast<double>(run_.numbers.front());
    const auto last = static_cast<double>(run_.numbers.back());
    const double margin = 0.02 * (last - first) + 0.5;
    json axis = html::titled("frame");
    axis["range"] = {first - margin, last + margin};
    return axis;
  }

  /// y (the lowest), y2, .. above one x axis of frames.
  [[nodiscard]] json stacked(int rows) const {
    json layout = {
        {"plot_height", 150 * rows}, {"hovermode", "x unified"}, {"xaxis", frames_axis()}};
    layout["xaxis"]["anchor"] = "y";
    constexpr double kGap = 0.06;
    for (int i = 0; i < rows; ++i) {
      const std::string key = i == 0 ? "yaxis" : fmt::format("yaxis{}", i + 1);
      layout[key] = {
          {"domain", {static_cast<double>(i) / rows + (i > 0 ? kGap : 0.0), (i + 1.0) / rows}}};
    }
    return layout;
  }

  const RunPage& run_;
  html::Page& page_;
  json numbers_;
  /// True metres up to each frame, and how far off it is; NaN for frames without a true pose,
  /// empty where none has one.
  std::vector<double> travelled_;
  std::vector<Eigen::Vector3d> errors_;
};

}  // namespace

Status write_run_page(const std::filesystem::path& file, const RunPage& run) {
  STEMVO_CHECK(!run.frames.empty() && run.estimate.size() == run.frames.size() &&
                   run.numbers.size() == run.frames.size() &&
                   (!run.ground_truth ||
                    (run.ground_truth->poses.size() == run.ground_truth->frames.size() &&
                     !run.ground_truth->frames.empty() &&
                     run.ground_truth->frames.back() < run.frames.size())),
               "a pose, a result and a number per frame, true poses of some");
  html::Page page(run.title, run.subtitle);
  const RunFigures figures(run, page);
  page.set_frames(figures.descriptions());
  figures.add_top_view();
  page.add_text("Numbers", format_metrics_table(run.report));
  figures.add_path_in_space();
  if (run.ground_truth) {
    figures.add_errors_over_distance();
    if (run.report.metrics->num_segments > 0) {
      figures.add_errors_by_length();
    }
  }
  figures.add_tracks();
  figures.add_scale_and_camera();
  figures.add_times();
  if (run.report.timing) {
    page.add_text("Stages", format_timing_table(*run.report.timing));
  }
  if (!run.images.empty()) {
    page.add_images("Frames and their channel", run.images);
  }
  html::add_how_to_repeat(page, run.command, "Configuration", run.config);
  return page.write(file);
}

}  // namespace stemvo
