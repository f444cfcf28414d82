// SPDX-License-Identifier: MIT
#include "report/evaluate_report.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "dataset/frame_files.hpp"
#include "report/metrics_json.hpp"
#include "text/text_table.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

constexpr std::array<std::string_view, 4> kAlignments = {"none", "scale", "se3", "sim3"};

constexpr double kDoubtful_percent = 50.0;  ///< errors of no odometry, of motions of any unit
constexpr double kFits = 0.2;               ///< of the error as given: it is the other convention

/// Mean error of motions over an eighth of the path, after the lengths were made alike.
double motion_error_percent(Trajectory estimate, std::span<const Rigid3> ground_truth) {
  constexpr std::size_t kMaxSegments = 500;
  const double scale = length_of_path(ground_truth) / length_of_path(estimate);
  for (Rigid3& pose : estimate) {
    pose.translation *= scale;
  }
  const std::vector<double> errors = dense_errors({estimate, ground_truth}, kMaxSegments).t_percent;
  return std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
}

Rigid3 with_w_first(const Rigid3& pose) {
  const Eigen::Vector4d read = pose.rotation.coeffs();
  return {Eigen::Quaterniond(read[0], read[1], read[2], read[3]), pose.translation};
}

/// The camera's motion of that of axes turned against it.
Rigid3 with_axes(const Rigid3& pose, const Eigen::Quaterniond& axes_from_camera) {
  const Rigid3 turn(axes_from_camera, Eigen::Vector3d::Zero());
  return turn.inverse() * pose * turn;
}

/// The convention that the poses seem to have where they are not the camera's in the world, as
/// world_from_camera, with x right, y down, z forward: camera_from_world, quaternions with w first,
/// a robot's axes or OpenGL's. Nullopt: they fit the ground truth as they are, or nothing explains
/// why they do not. Both have the same length. Lengths may have any unit.
std::optional<std::string> other_convention(std::span<const Rigid3> estimate,
                                            std::span<const Rigid3> ground_truth) {
  const Eigen::Quaterniond robot_from_camera(0.5, -0.5, 0.5, -0.5);
  const Eigen::Quaterniond opengl_from_camera(0.0, 1.0, 0.0, 0.0);
  const double given_percent = motion_error_percent(relative_to_first(estimate), ground_truth);
  if (!(given_percent > kDoubtful_percent)) {
    return std::nullopt;
  }
  const auto error_percent = [&](const auto& convert) {
    Trajectory poses(estimate.begin(), estimate.end());
    std::ranges::transform(poses, poses.begin(), convert);
    return motion_error_percent(std::move(poses), ground_truth);
  };
  const std::pair<const char*, double> others[] = {
      {"camera_from_world, the inverse of world_from_camera",
       error_percent([](const Rigid3& pose) { return pose.inverse(); })},
      {"quaternions with w first", error_percent(with_w_first)},
      {"of axes x forward, y left, z up",
       error_percent([&](const Rigid3& pose) { return with_axes(pose, robot_from_camera); })},
      {"of axes x right, y up, z backward",
       error_percent([&](const Rigid3& pose) { return with_axes(pose, opengl_from_camera); })}};
  const auto& [name, percent] =
      *std::ranges::min_element(others, {}, [](const auto& other) { return other.second; });
  if (!(percent < kFits * given_percent)) {
    return std::nullopt;
  }
  return fmt::format("the poses seem to be {}: motions would be off by {:.2g} % for {:.2g} %", name,
                     percent, given_percent);
}

struct Pairs {
  Trajectory estimate;
  Trajectory truth;
};

void cut(PoseFile& file, const FrameRange& range) {
  const auto part = [&range](auto& all) {
    all = {all.begin() + static_cast<std::ptrdiff_t>(range.begin),
           all.begin() + static_cast<std::ptrdiff_t>(range.end)};
  };
  part(file.poses);
  if (!file.timestamps_s.empty()) {
    part(file.timestamps_s);
  }
}

Expected<Pairs> pair_poses(const PoseFile& estimate, const PoseFile& truth, double tolerance_s) {
  if (estimate.timestamps_s.empty() || truth.timestamps_s.empty()) {
    if (estimate.poses.size() == truth.poses.size()) {
      return Pairs{estimate.poses, truth.poses};
    }
    return fail(fmt::format(
        "{}: expected {} poses as in {}, found {} (poses are compared line by line "
        "unless both files have times, as TUM's and EuRoC's; --frames A:B takes some of the "
        "ground truth's)",
        estimate.file.string(), truth.poses.size(), truth.file.string(), estimate.poses.size()));
  }
  const TimePairs pairs = pair_by_time(estimate.timestamps_s, truth.timestamps_s, tolerance_s);
  STEMVO_TRY(dataset::check_pairs(truth, estimate.file.string(), estimate.timestamps_s, pairs,
                                  tolerance_s));
  return Pairs{take_poses(estimate.poses, pairs.first), take_poses(truth.poses, pairs.second)};
}

void add_row(TextTable& table, const EvaluationRow& row, Alignment alignment) {
  const auto texts = metric_texts(row.metrics);
  table.add({row.name, texts[0], texts[1], texts[2],
             texts[kAteText + static_cast<std::size_t>(alignment)], texts[8], texts[9]});
}

}  // namespace

// Found by nlohmann's library.
void to_json(nlohmann::ordered_json& json, const EvaluationRow& row) {
  json = {{"file", row.name}, {"compared_poses", row.num_pairs}};
  add_metrics(json, row.metrics);
  if (row.doubt) {
    json["warning"] = *row.doubt;
  }
}

Expected<EvaluationReport> evaluate_files(const EvaluationRequest& request) {
  STEMVO_TRY_GET(auto truth, dataset::read_truth(request.ground_truth, request.camera_file));
  const std::size_t num_lines = truth.poses.size();
  STEMVO_TRY_GET(const FrameRange range,
                 dataset::resolve_range(request.frames, num_lines, request.ground_truth.string()));
  cut(truth, range);
  EvaluationReport report;
  report.ground_truth = request.ground_truth.string();
  report.num_poses = truth.poses.size();
  report.alignment = request.alignment;
  for (const std::filesystem::path& file : request.estimates) {
    STEMVO_TRY_GET(auto estimate, dataset::read_truth(file, request.camera_file));
    if (estimate.timestamps_s.empty() && estimate.poses.size() == num_lines) {
      cut(estimate, range);
    }
    STEMVO_TRY_GET(const Pairs pairs, pair_poses(estimate, truth, request.tolerance_s));
    const auto& [compared, with] = pairs;
    if (compared.size() < 2) {
      return fail(file.string() + ": expected at least 2 poses, for motions are compared, found 1");
    }
    report.rows.push_back({file.string(), evaluate_aligned({compared, with}, request.alignment),
                           estimate.poses.size(), compared.size(),
                           other_convention(compared, with)});
  }
  // No alignment: a fit would move the whole heap of points into the middle of the drive.
  report.zero_motion = {"(zero motion)", evaluate({Trajectory(truth.poses.size()), truth.poses}),
                        truth.poses.size(), truth.poses.size()};
  return report;
}

std::string format_evaluation_table(const EvaluationReport& report) {
  const Metrics& zero_motion = report.zero_motion.metrics;
  TextTable table("lrrrrrr");
  table.add({"estimate", "t_rel %", "r_rel deg/100 m", "offset m", "ATE m", "RPE m", "RPE deg"});
  table.rule();
  for (const EvaluationRow& row : report.rows) {
    add_row(table, row, report.alignment);
  }
  add_row(table, report.zero_motion, Alignment::kNone);
  const auto [least, most] = std::ranges::minmax(
      report.rows, {}, [](const EvaluationRow& row) { return row.metrics.num_segments; });
  const int few = least.metrics.num_segments;
  const int many = most.metrics.num_segments;
  const std::string segments =
      many == 0
          ? fmt::format("no segment of {} fits into the drive: no t_rel and r_rel",
                        length_range(least.metrics.segment_lengths_m))
          : fmt::format("t_rel and r_rel: mean over {} segments of {}",
                        few == many ? std::to_string(few) : fmt::format("{} to {}", few, many),
                        length_range(least.metrics.segment_lengths_m));
  std::string notes;
  for (const EvaluationRow& row : report.rows) {
    if (row.num_pairs < row.num_poses) {
      notes += fmt::format("{}: {} of {} poses have no true pose of their time\n", row.name,
                           row.num_poses - row.num_pairs, row.num_poses);
    }
    if (row.num_pairs < report.num_poses) {
      notes += fmt::format("{}: a pose for {} of {} true ones: steps are those between them\n",
                           row.name, row.num_pairs, report.num_poses);
    }
    if (row.doubt) {
      notes += fmt::format("warning: {}: {}\n", row.name, *row.doubt);
    }
  }
  return fmt::format(
      "ground truth  {}, {} poses, {:.1f} m\nalignment     {} (the last row: none)\n\n{}\n{}\n"
      "offset: mean of |dx| + |dz|; ATE: root mean square position error; RPE: mean error of "
      "the step of one frame\n{}",
      report.ground_truth, report.num_poses, zero_motion.path_length_m, to_string(report.alignment),
      table.str(), segments, notes);
}

nlohmann::ordered_json evaluation_document(const EvaluationReport& report) {
  return {{"ground_truth", report.ground_truth},
          {"poses", report.num_poses},
          {"alignment", to_string(report.alignment)},
          {"estimates", report.rows},
          {"zero_motion", report.zero_motion}};
}

Expected<Alignment> parse_alignment(const std::string& text) {
  const auto* const found = std::find(kAlignments.begin(), kAlignments.end(), text);
  if (found == kAlignments.end()) {
    return fail(fmt::format("alignment: expected none, scale, se3 or sim3, found '{}'", text));
  }
  return static_cast<Alignment>(found - kAlignments.begin());
}

std::string_view to_string(Alignment alignment) {
  return kAlignments.at(static_cast<std::size_t>(alignment));
}

}  // namespace stemvo
