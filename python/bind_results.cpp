// SPDX-License-Identifier: MIT
// Result: what an odometry gives.
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nanobind/eigen/dense.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"

namespace stemvo::python {
namespace {

using namespace nb::literals;

void bind_result(nb::module_& module) {
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
          "motion_covariance", [](const FrameResult& r) { return r.motion_covariance; },
          "6x6, of the motion since the last frame: x y z, then rotation, about this frame's axes")
      .def_prop_ro("state", [](const FrameResult& r) { return std::string(to_string(r.state)); })
      .def_prop_ro("is_measured", [](const FrameResult& r) { return is_measured(r.state); })
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
          "camera_sigma", [](const FrameResult& r) { return r.camera_sigma; },
          "None: the camera is not refined")
      .def_prop_ro("problem", [](const FrameResult& r) { return r.problem; })
      .def("__repr__", [](const FrameResult& r) {
        const auto& at = r.world_from_camera.translation;
        return fmt::format("Result({}, {} of {} inliers, at {:.3f} {:.3f} {:.3f})",
                           to_string(r.state), r.num_inliers, r.num_matches, at.x(), at.y(),
                           at.z());
      });
}

}  // namespace

void bind_results(nb::module_& module) { bind_result(module); }

}  // namespace stemvo::python
