// SPDX-License-Identifier: MIT
// Recordings and evaluation: the program's readers and metrics in Python.
#include <filesystem>
#include <optional>
#include <variant>

#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>

#include "arrays.hpp"
#include "dataset/frame_source.hpp"
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
  result["rpe_rotation_deg"] = metrics.rpe_rotation_deg;
  return result;
}

FrameSource open_recording(const Path& path, const std::optional<Path>& camera_file) {
  FrameSourceRequest request;
  request.sequence_dir = path;
  request.camera_file = camera_file;
  auto opened = [&] {
    const nb::gil_scoped_release release;
    return open_source(request);
  }();
  FrameSource source = value_or_raise(std::move(opened));
  if (source.stream()) {
    throw nb::value_error(
        fmt::format("{}: expected a folder of images, found a video or a camera", path.string())
            .c_str());
  }
  return source;
}

std::pair<ByteArray, double> frame_of(const FrameSource& source, std::size_t index) {
  if (index >= source.size()) {
    throw nb::index_error("frame: behind the last");
  }
  auto image = [&] {
    const nb::gil_scoped_release release;
    return source.read(index);
  }();
  return {array_of(value_or_raise(std::move(image))), source.time_s(index)};
}

nb::object truth_of(const FrameSource& source) {
  if (!source.ground_truth()) {
    return nb::none();
  }
  return nb::cast(array_of(*source.ground_truth()));
}

}  // namespace

void bind_files(nb::module_& module) {
  nb::class_<FrameSource>(module, "Recording",
                          "Frames of a folder: `for image, timestamp in recording`")
      .def("__len__", &FrameSource::size)
      .def("__getitem__", &frame_of, "index"_a)
      .def_prop_ro("camera", [](const FrameSource& s) { return s.camera(); })
      .def_prop_ro("camera_height_m", [](const FrameSource& s) { return s.camera_height_m(); })
      .def_prop_ro(
          "timestamps", [](const FrameSource& s) { return array_of(s.timestamps_s()); },
          nb::rv_policy::move)
      .def_prop_ro("ground_truth", &truth_of,
                   nb::sig("def ground_truth(self) -> numpy.typing.NDArray[numpy.float64] | None"),
                   "Nx4x4 of the frames that have a true pose");
  module.def("read_recording", &open_recording, "path"_a, "camera_file"_a = nb::none(),
             "What `stemvo run` reads, but for videos and live cameras");
  module.def("evaluate", &evaluate_poses, "estimate"_a, "truth"_a, "align"_a = "none",
             "Files or Nx4x4 arrays; align: none, scale, se3, sim3");
}

}  // namespace stemvo::python
