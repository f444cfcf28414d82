// SPDX-License-Identifier: MIT
// Evaluation: the program's metrics in Python.
#include <algorithm>
#include <filesystem>
#include <numeric>
#include <optional>
#include <type_traits>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>
#include <nlohmann/json.hpp>

#include "arrays.hpp"
#include "dataset/frame_files.hpp"
#include "report/evaluate_report.hpp"
#include "report/metrics_json.hpp"

namespace stemvo::python {
namespace {

using namespace nb::literals;
using Path = std::filesystem::path;
using PosesArgument = std::variant<Path, GivenArray>;

Expected<Trajectory> poses_of(const PosesArgument& given, const std::string& name) {
  if (const auto* const array = std::get_if<GivenArray>(&given)) {
    return trajectory_of(*array, name);
  }
  return dataset::read_truth(std::get<Path>(given), std::nullopt).map([](const PoseFile& file) {
    return file.poses;
  });
}

Expected<Metrics> compare(const PosesArgument& estimate,
                          const PosesArgument& truth,
                          Alignment alignment) {
  if (std::holds_alternative<Path>(estimate) && std::holds_alternative<Path>(truth)) {
    return evaluate_files({std::get<Path>(truth), {std::get<Path>(estimate)}, alignment})
        .map([](const EvaluationReport& report) { return report.rows.front().metrics; });
  }
  const auto poses = poses_of(estimate, "estimate");
  const auto true_poses = poses_of(truth, "truth");
  if (!poses || !true_poses) {
    return poses ? true_poses.error() : poses.error();
  }
  if (poses->size() != true_poses->size()) {
    return fail(fmt::format("estimate: expected {} poses as in truth, found {}", true_poses->size(),
                            poses->size()));
  }
  if (poses->size() < 2) {
    return fail(fmt::format("estimate: expected at least 2 poses, found {}", poses->size()));
  }
  return evaluate_aligned({*poses, *true_poses}, alignment);
}

nb::dict evaluate_poses(const PosesArgument& estimate,
                        const PosesArgument& truth,
                        const std::string& align) {
  const Alignment alignment = value_or_raise(parse_alignment(align));
  auto compared = [&] {
    const nb::gil_scoped_release release;
    return compare(estimate, truth, alignment);
  }();
  const Metrics metrics = value_or_raise(std::move(compared));
  nlohmann::ordered_json json;  // as metrics.json has them
  json["alignment"] = to_string(alignment);
  add_metrics(json, metrics);
  return nb::cast<nb::dict>(nb::module_::import_("json").attr("loads")(json.dump()));
}

DoubleArray align_poses(const GivenArray& estimate,
                        const GivenArray& truth,
                        const std::optional<std::vector<std::size_t>>& frames,
                        const std::string& align) {
  const Alignment alignment = value_or_raise(parse_alignment(align));
  const Trajectory poses = value_or_raise(trajectory_of(estimate, "estimate"));
  const Trajectory true_poses = value_or_raise(trajectory_of(truth, "truth"));
  std::vector<std::size_t> which = frames.value_or(std::vector<std::size_t>(poses.size()));
  if (!frames) {
    std::iota(which.begin(), which.end(), std::size_t{0});
  }
  if (which.size() != true_poses.size() ||
      std::ranges::any_of(which, [&](std::size_t frame) { return frame >= poses.size(); })) {
    throw nb::value_error(
        fmt::format("frames: expected a frame of {} poses for each of {} in truth, found {}",
                    poses.size(), true_poses.size(), which.size())
            .c_str());
  }
  return array_of(align_trajectory(poses, which, true_poses, alignment));
}

struct TrajectoryPair {
  Trajectory estimate;
  Trajectory truth;
};

/// As many of the one as of the other.
TrajectoryPair pair_of(const GivenArray& estimate, const GivenArray& truth) {
  TrajectoryPair pair{value_or_raise(trajectory_of(estimate, "estimate")),
                      value_or_raise(trajectory_of(truth, "truth"))};
  if (pair.estimate.size() != pair.truth.size()) {
    throw nb::value_error(fmt::format("estimate: expected {} poses as in truth, found {}",
                                      pair.truth.size(), pair.estimate.size())
                              .c_str());
  }
  return pair;
}

DoubleArray with_true_steps(const GivenArray& estimate, const GivenArray& truth) {
  const TrajectoryPair pair = pair_of(estimate, truth);
  return array_of(rescale_steps({pair.estimate, pair.truth}));
}

nb::dict errors_by_segment(const GivenArray& estimate,
                           const GivenArray& truth,
                           const std::optional<std::vector<double>>& lengths_m,
                           std::size_t every) {
  const TrajectoryPair pair = pair_of(estimate, truth);
  if (every == 0) {
    throw nb::value_error("every: expected at least 1, found 0");
  }
  if (lengths_m && !std::ranges::all_of(*lengths_m, [](double m) { return m > 0.0; })) {
    throw nb::value_error("lengths_m: expected lengths above 0");
  }
  const auto errors = [&] {
    const nb::gil_scoped_release release;
    return segment_errors(
        {pair.estimate, pair.truth},
        lengths_m ? *lengths_m : evaluate({pair.estimate, pair.truth}).segment_lengths_m, every);
  }();
  const auto column = [&](auto member) {
    std::vector<std::remove_cvref_t<decltype(errors.front().*member)>> values;
    for (const SegmentError& error : errors) {
      values.push_back(error.*member);
    }
    return array_of(values);
  };
  nb::dict result;
  result["first"] = column(&SegmentError::first);
  result["last"] = column(&SegmentError::last);
  result["length_m"] = column(&SegmentError::length_m);
  result["t_percent"] = column(&SegmentError::t_percent);
  result["r_deg_per_100m"] = column(&SegmentError::r_deg_per_100m);
  return result;
}

nb::dict dense_errors_of(const GivenArray& estimate,
                         const GivenArray& truth,
                         std::size_t max_segments) {
  if (max_segments == 0) {
    throw nb::value_error("max_segments: expected at least 1, found 0");
  }
  const TrajectoryPair pair = pair_of(estimate, truth);
  const DenseErrors errors = [&] {
    const nb::gil_scoped_release release;
    return dense_errors({pair.estimate, pair.truth}, max_segments);
  }();
  nb::dict result;
  result["t_percent"] = array_of(errors.t_percent);
  result["r_deg_per_100m"] = array_of(errors.r_deg_per_100m);
  result["block"] = errors.block;
  return result;
}

nb::tuple read_poses(const Path& file, const std::optional<Path>& camera_file) {
  const PoseFile read = value_or_raise(dataset::read_truth(file, camera_file));
  return nb::make_tuple(array_of(read.poses), read.timestamps_s.empty()
                                                  ? nb::object(nb::none())
                                                  : nb::cast(array_of(read.timestamps_s)));
}

nb::tuple pair_times(const std::vector<double>& first,
                     const std::vector<double>& second,
                     double tolerance_s) {
  if (!std::ranges::is_sorted(first) || !std::ranges::is_sorted(second)) {
    throw nb::value_error("pair_by_time: expected times that rise");
  }
  const TimePairs pairs = pair_by_time(first, second, tolerance_s);
  return nb::make_tuple(array_of(pairs.first), array_of(pairs.second));
}

void bind_comparison(nb::module_& module) {
  module.def("rescale_steps", &with_true_steps, "estimate"_a, "truth"_a,
             "Each step in its own direction with the true step's length (the paper's protocol)");
  module.def("segment_errors", &errors_by_segment, "estimate"_a, "truth"_a,
             "lengths_m"_a = nb::none(), "every"_a = 10,
             "Columns first, last, length_m, t_percent, r_deg_per_100m: the KITTI devkit's "
             "segments, from every so many frames on. lengths_m: None: as evaluate takes them");
  module.def("dense_errors", &dense_errors_of, "estimate"_a, "truth"_a, "max_segments"_a = 400,
             "t_percent and r_deg_per_100m of segments of an eighth of the path, evenly spaced, "
             "and how many neighbours overlap: block");
  module.def("read_trajectory", &read_poses, "file"_a, "camera_file"_a = nb::none(),
             "KITTI's, TUM's or EuRoC's format: Nx4x4, and N seconds or None. camera_file: with "
             "EuRoC's, whose T_BS says how the camera sits on the body");
  module.def("pair_by_time", &pair_times, "first"_a, "second"_a, "tolerance_s"_a = kTimeTolerance_s,
             "Indices of times that are each the nearest of the other, of rising ones");
}

}  // namespace

void bind_evaluation(nb::module_& module) {
  module.def("evaluate", &evaluate_poses, "estimate"_a, "truth"_a, "align"_a = "none",
             "Files or Nx4x4 arrays; align: none, scale, se3, sim3. As metrics.json has it");
  module.def(
      "align", &align_poses, "estimate"_a, "truth"_a, "frames"_a = nb::none(), "align"_a = "sim3",
      "The estimate as report.html draws it: moved to start at the first true pose, fitted to "
      "the truth. frames: indices of the poses that have a true one; None: all");
  bind_comparison(module);
}

}  // namespace stemvo::python