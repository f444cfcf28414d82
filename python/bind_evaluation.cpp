// SPDX-License-Identifier: MIT
// Evaluation: the program's metrics in Python.
#include <algorithm>
#include <filesystem>
#include <numeric>
#include <optional>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "dataset/ground_truth.hpp"
#include "report/evaluate_report.hpp"

namespace stemvo::python {
namespace {

using namespace nb::literals;
using Path = std::filesystem::path;
using PosesArgument = std::variant<Path, AnyArray>;

Expected<Trajectory> poses_of(const PosesArgument& given, const std::string& name) {
  if (const auto* const array = std::get_if<AnyArray>(&given)) {
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
  return evaluate_aligned(*poses, *true_poses, alignment);
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
  nb::dict result;  // the keys of metrics.json
  result["t_rel_percent"] = metrics.t_rel_percent;
  result["r_rel_deg_per_100m"] = metrics.r_rel_deg_per_100m;
  result["ate_rmse_m"] = metrics.ate_rmse.after_m(alignment);
  result["average_offset_m"] = metrics.average_offset_m;
  result["path_length_m"] = metrics.path_length_m;
  result["rpe_translation_m"] = metrics.rpe_translation_m;
  result["rpe_rotation_deg"] = metrics.rpe_rotation_deg;
  return result;
}

DoubleArray align_poses(const AnyArray& estimate,
                        const AnyArray& truth,
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

}  // namespace

void bind_evaluation(nb::module_& module) {
  module.def("evaluate", &evaluate_poses, "estimate"_a, "truth"_a, "align"_a = "none",
             "Files or Nx4x4 arrays; align: none, scale, se3, sim3");
  module.def(
      "align", &align_poses, "estimate"_a, "truth"_a, "frames"_a = nb::none(), "align"_a = "sim3",
      "The estimate as report.html draws it: moved to start at the first true pose, fitted to "
      "the truth. frames: indices of the poses that have a true one; None: all");
}

}  // namespace stemvo::python
