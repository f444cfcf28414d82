// SPDX-License-Identifier: MIT
// Result, MapChanges, Keyframe, AdjustedMap: what an odometry gives.
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nanobind/eigen/dense.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "report/data_files.hpp"
#include "stemvo/map.hpp"

namespace stemvo::python {
namespace {

using namespace nb::literals;

/// What a row of frames.csv holds between the frame's number and its errors.
nb::list row_of(const FrameResult& r) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  constexpr const char* kModels[] = {"none", "homography", "essential"};  // by TwoViewModel
  nb::list row;
  const auto add = [&](const auto&... values) { (row.append(values), ...); };
  const auto add_pose = [&](const Eigen::Vector3d& t, const Eigen::Quaterniond& q) {
    add(t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  };
  add(r.time_s, std::string(to_string(r.state)), r.num_matches, r.num_inliers, r.homography_score,
      r.fundamental_score, r.homography_ratio, kModels[static_cast<std::size_t>(r.model)],
      r.times.stem_ms, r.times.features_ms, r.times.pose_ms, r.scale_sigma.value_or(kNone),
      std::string(to_string(r.scale_state)), r.camera.fx_px, r.camera.cx_px, r.camera.cy_px);
  const CameraSigma sigma = r.camera_sigma.value_or(CameraSigma{kNone, kNone, kNone});
  add(sigma.fx_px, sigma.cx_px, sigma.cy_px,
      r.recognized_frame == -1 ? kNone : static_cast<double>(r.recognized_frame),
      r.map_from_world.scale);
  add_pose(r.map_from_world.translation, r.map_from_world.rotation);
  add(r.map_id, static_cast<int>(r.is_scale_new));
  add_pose(r.world_from_camera.translation, r.world_from_camera.rotation);
  for (const double variance : r.motion_covariance.diagonal()) {
    add(variance);
  }
  return row;
}

void bind_result(nb::module_& module) {
  module.attr("FRAMES_CSV_HEADER") = std::string(kFramesCsvHeader);
  nb::class_<CameraSigma>(module, "CameraSigma", "Standard deviations of a camera, in pixels")
      .def_ro("fx", &CameraSigma::fx_px)
      .def_ro("cx", &CameraSigma::cx_px)
      .def_ro("cy", &CameraSigma::cy_px)
      .def("__repr__", [](const CameraSigma& s) {
        return fmt::format("CameraSigma(fx={}, cx={}, cy={})", s.fx_px, s.cx_px, s.cy_px);
      });
  nb::class_<FrameResult>(module, "Result", "A frame's pose and how it came about")
      .def_prop_ro(
          "world_from_camera", [](const FrameResult& r) { return array_of(r.world_from_camera); },
          nb::rv_policy::move, "4x4")
      .def_prop_ro(
          "map_from_world",
          [](const FrameResult& r) {
            Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
            const Similarity3& map_from_world = r.map_from_world;
            matrix.topLeftCorner<3, 3>() =
                map_from_world.scale * map_from_world.rotation.toRotationMatrix();
            matrix.topRightCorner<3, 1>() = map_from_world.translation;
            return matrix;
          },
          "4x4, a similarity: the correction so far, by places that were recognized")
      .def_prop_ro(
          "recognized_frame",
          [](const FrameResult& r) {
            return r.recognized_frame == -1 ? std::nullopt : std::optional(r.recognized_frame);
          },
          "Whose place this one shows; below -1: of a map that was loaded, whose last keyframe is "
          "-2 "
          "and the frame n before that -2 - n; None: none recognized")
      .def_prop_ro(
          "motion_covariance", [](const FrameResult& r) { return r.motion_covariance; },
          "6x6, of the motion since the last frame: x y z, then rotation, about this frame's axes")
      .def_prop_ro("state", [](const FrameResult& r) { return std::string(to_string(r.state)); })
      .def_prop_ro("is_measured", [](const FrameResult& r) { return r.is_measured; })
      .def_prop_ro(
          "map_id", [](const FrameResult& r) { return r.map_id; },
          "The map that holds the pose, counted from 0; -1: of another recording")
      .def_prop_ro(
          "is_scale_new", [](const FrameResult& r) { return r.is_scale_new; },
          "A map begins here: lengths before it had another unit")
      .def_ro("timestamp", &FrameResult::time_s, "As given")
      .def_prop_ro("num_matches", [](const FrameResult& r) { return r.num_matches; })
      .def_prop_ro("num_inliers", [](const FrameResult& r) { return r.num_inliers; })
      .def_prop_ro("scale_state",
                   [](const FrameResult& r) { return std::string(to_string(r.scale_state)); })
      .def_prop_ro(
          "scale_sigma", [](const FrameResult& r) { return r.scale_sigma; },
          "Of log(metres per unit); None: the road is not asked")
      .def_prop_ro("road_reason", [](const FrameResult& r) { return std::string(r.road_reason); })
      .def_prop_ro(
          "camera", [](const FrameResult& r) { return r.camera; }, "With what was learnt so far")
      .def_prop_ro(
          "radial", [](const FrameResult& r) { return r.radial; },
          "k1, k2 of a distortion that frames had nevertheless: pixels are freed of it")
      .def_prop_ro(
          "camera_sigma", [](const FrameResult& r) { return r.camera_sigma; },
          "None: the camera is not refined")
      .def_prop_ro("csv_row", &row_of, "As in frames.csv, without the frame's number and errors")
      .def_prop_ro("problem", [](const FrameResult& r) { return r.problem; })
      .def("__repr__", [](const FrameResult& r) {
        const auto& at = r.world_from_camera.translation;
        return fmt::format("Result({}, {} of {} inliers, at {:.3f} {:.3f} {:.3f})",
                           to_string(r.state), r.num_inliers, r.num_matches, at.x(), at.y(),
                           at.z());
      });
}

void bind_map(nb::module_& module) {
  nb::class_<MapChanges>(module, "MapChanges", "Landmarks that came, moved or went")
      .def_ro("version", &MapChanges::version, "To ask with the next time")
      .def_prop_ro(
          "ids",
          [](const MapChanges& c) {
            std::vector<int> ids;
            for (const MapLandmark& landmark : c.landmarks) {
              ids.push_back(landmark.id);
            }
            return array_of(ids);
          },
          nb::rv_policy::move, "N, of those that came or moved")
      .def_prop_ro(
          "positions", [](const MapChanges& c) { return arrays_of(c.landmarks).first; },
          nb::rv_policy::move, "Nx3, in the world")
      .def_prop_ro(
          "colors", [](const MapChanges& c) { return arrays_of(c.landmarks).second; },
          nb::rv_policy::move, "Nx3, RGB")
      .def_prop_ro(
          "removed", [](const MapChanges& c) { return array_of(c.removed); }, nb::rv_policy::move,
          "Ids; some may never have been given");
  nb::class_<MapKeyframe>(module, "Keyframe", "A frame that landmarks were triangulated from")
      .def_ro("id", &MapKeyframe::id, "Counted from 0")
      .def_ro("frame", &MapKeyframe::frame, "Results before its own")
      .def_ro("timestamp", &MapKeyframe::time_s)
      .def_prop_ro(
          "world_from_camera", [](const MapKeyframe& k) { return array_of(k.world_from_camera); },
          nb::rv_policy::move, "4x4, as it came");
}

void bind_adjusted_map(nb::module_& module) {
  nb::class_<AdjustedKeyframe>(module, "AdjustedKeyframe")
      .def_ro("frame", &AdjustedKeyframe::frame, "Results before its own")
      .def_ro("timestamp", &AdjustedKeyframe::time_s)
      .def_prop_ro(
          "map_from_camera", [](const AdjustedKeyframe& k) { return array_of(k.map_from_camera); },
          nb::rv_policy::move, "4x4")
      .def_prop_ro(
          "covariance", [](const AdjustedKeyframe& k) { return k.covariance; },
          "6x6, in the camera's axes: x y z, then rotation; None: not asked for");
  nb::class_<AdjustedMap>(module, "AdjustedMap", "All that was seen, adjusted at once")
      .def_prop_ro(
          "map_from_camera", [](const AdjustedMap& m) { return array_of(m.map_from_camera); },
          nb::rv_policy::move, "Nx4x4, of all frames")
      .def_prop_ro("keyframes", [](const AdjustedMap& m) { return m.keyframes; })
      .def_prop_ro(
          "landmarks", [](const AdjustedMap& m) { return arrays_of(m.landmarks); },
          nb::rv_policy::move, "Nx3 in the map, and Nx3 colours")
      .def_prop_ro(
          "loops",
          [](const AdjustedMap& m) {
            std::vector<std::pair<int, int>> frames;
            for (const MapLoop& loop : m.loops) {
              frames.emplace_back(loop.from_frame, loop.to_frame);
            }
            return frames;
          },
          "Pairs of frames that show one place")
      .def_prop_ro(
          "camera", [](const AdjustedMap& m) { return m.camera; }, "As all frames tell it")
      .def_prop_ro(
          "camera_sigma", [](const AdjustedMap& m) { return m.camera_sigma; },
          "None: the camera is not refined");
}

}  // namespace

void bind_results(nb::module_& module) {
  bind_result(module);
  bind_map(module);
  bind_adjusted_map(module);
}

}  // namespace stemvo::python
