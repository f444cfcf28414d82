// SPDX-License-Identifier: MIT
// Camera, Options, Odometry, Result: the public headers in Python.
#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "config/config.hpp"
#include "dataset/camera_height.hpp"
#include "frames.hpp"
#include "options/visit.hpp"

namespace stemvo::python {
namespace {

using namespace nb::literals;

/// As --set takes it.
std::string text_of(nb::handle value) {
  if (value.is_none()) {
    throw nb::value_error("options: expected a value, found None");
  }
  return PyBool_Check(value.ptr()) ? (value.is(Py_True) ? "true" : "false")
                                   : nb::str(value).c_str();
}

void apply(Config& config, const nb::dict& values) {
  for (const auto& [key, value] : values) {
    const Status status =
        apply_override(config, std::string(nb::str(key).c_str()) + "=" + text_of(value));
    if (!status) {
      throw nb::value_error(in_python(status.error().message).c_str());
    }
  }
  value_or_raise(validate(config));
}

/// Odometry is used by one thread at a time; Python may call from several.
class SafeOdometry {
 public:
  SafeOdometry(const Camera& camera, const Config& config, const cv::Mat& mask)
      : scale_source_(options::to_string(config.scale.source)),
        odometry_(create(camera, config, mask)) {}

  [[nodiscard]] const std::string& scale_source() const { return scale_source_; }

  FrameResult process(const AnyArray& image, double timestamp) {
    const ImageView view = value_or_raise(view_of(image));
    return value_or_raise(
        call([&](Odometry& o) { return o.process(view.pixels, view.order, timestamp); }));
  }
  std::pair<DoubleArray, ByteArray> landmarks() {
    return arrays_of(call([](Odometry& o) { return o.landmarks(); }));
  }
  std::pair<DoubleArray, BoolArray> tracked_points() {
    return arrays_of(call([](Odometry& o) { return o.tracked_points(); }));
  }
  ByteArray channel_image() {
    return array_of(call([](Odometry& o) { return o.channel_image(); }));
  }

 private:
  static Odometry create(const Camera& camera, const Config& config, const cv::Mat& mask) {
    auto made = [&]() -> Expected<Odometry> {
      const nb::gil_scoped_release release;
      return Odometry::create(camera, config, mask);
    }();
    return value_or_raise(std::move(made));
  }
  template <typename F>
  std::invoke_result_t<F, Odometry&> call(F f) {
    const nb::gil_scoped_release release;
    const std::scoped_lock lock(mutex_);
    return f(odometry_);
  }

  std::string scale_source_;
  std::mutex mutex_;
  Odometry odometry_;
};

/// By the enumerator's number.
constexpr std::array<const char*, 3> kDistortions = {"none", "radial-tangential", "equidistant"};

void set_distortion(Camera& camera,
                    const std::string& distortion,
                    const std::vector<double>& coefficients) {
  const auto found = std::ranges::find(kDistortions, distortion);
  if (found == kDistortions.end() || coefficients.size() > camera.distortion_coefficients.size()) {
    throw nb::value_error(
        fmt::format("distortion: expected one of {} with at most {} coefficients, "
                    "found '{}' with {}",
                    fmt::join(kDistortions, ", "), camera.distortion_coefficients.size(),
                    distortion, coefficients.size())
            .c_str());
  }
  camera.distortion = static_cast<Distortion>(found - kDistortions.begin());
  std::ranges::copy(coefficients, camera.distortion_coefficients.begin());
}

void bind_camera(nb::module_& module) {
  nb::class_<Camera>(
      module, "Camera",
      "Pinhole camera, in pixels; distortion is none, radial-tangential (k1 k2 p1 p2 k3) "
      "or equidistant (k1 k2 k3 k4)")
      .def(
          "__init__",
          [](Camera* self, double fx, double fy, double cx, double cy, int width, int height,
             const std::string& distortion, const std::vector<double>& coefficients) {
            new (self) Camera{fx, fy, cx, cy, width, height};
            set_distortion(*self, distortion, coefficients);
          },
          "fx"_a, "fy"_a, "cx"_a, "cy"_a, "width"_a, "height"_a, "distortion"_a = "none",
          "coefficients"_a = std::vector<double>())
      .def_ro("fx", &Camera::fx_px)
      .def_ro("fy", &Camera::fy_px)
      .def_ro("cx", &Camera::cx_px)
      .def_ro("cy", &Camera::cy_px)
      .def_ro("width", &Camera::width_px)
      .def_ro("height", &Camera::height_px)
      .def_prop_ro(
          "distortion",
          [](const Camera& c) { return kDistortions.at(static_cast<std::size_t>(c.distortion)); })
      .def_prop_ro("coefficients",
                   [](const Camera& c) {
                     return std::vector<double>(c.distortion_coefficients.begin(),
                                                c.distortion_coefficients.end());
                   })
      .def("__repr__", [](const Camera& c) {
        return fmt::format("Camera(fx={}, fy={}, cx={}, cy={}, width={}, height={})", c.fx_px,
                           c.fy_px, c.cx_px, c.cy_px, c.width_px, c.height_px);
      });
}

void bind_options(nb::module_& module) {
  nb::class_<Config>(module, "Options", "The keys of `stemvo --dump-config`")
      .def(
          "__init__",
          [](Config* self, const nb::dict& values) {
            Config config;
            apply(config, values);
            new (self) Config(std::move(config));
          },
          "values"_a = nb::dict(), "E.g. {'stem.filter': 3}; ValueError: a bad key or value")
      .def_static(
          "load",
          [](const std::filesystem::path& file) { return value_or_raise(load_config(file)); },
          "file"_a, "A configuration file of the program")
      .def("__str__", &dump_config, "All keys as YAML");
}

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
      .def_prop_ro("state", [](const FrameResult& r) { return std::string(to_string(r.state)); })
      .def_prop_ro("is_measured", [](const FrameResult& r) { return is_measured(r.state); })
      .def_ro("timestamp", &FrameResult::time_s, "As given")
      .def_prop_ro("num_matches", [](const FrameResult& r) { return r.num_matches; })
      .def_prop_ro("num_inliers", [](const FrameResult& r) { return r.num_inliers; })
      .def_prop_ro("scale_state",
                   [](const FrameResult& r) { return std::string(to_string(r.scale_state)); })
      .def_prop_ro(
          "scale_sigma", [](const FrameResult& r) { return r.scale_sigma; },
          "Of log(metres per unit)")
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

Config config_of(const nb::object& options) {
  Config config;
  if (nb::isinstance<Config>(options)) {
    config = nb::cast<Config>(options);
  } else if (nb::isinstance<nb::dict>(options)) {
    apply(config, nb::cast<nb::dict>(options));
  } else if (!options.is_none()) {
    throw nb::type_error("options: expected Options or a dict");
  }
  return config;
}

void make_odometry(SafeOdometry* self, const nb::object& camera, const nb::object& options) {
  const Config config = config_of(options);
  if (const FrameList* frames = frames_of(camera)) {
    new (self)
        SafeOdometry(frames->camera, dataset::with_camera_height(config, *frames), frames->mask);
  } else if (nb::isinstance<Camera>(camera)) {
    const Camera& plain = nb::cast<const Camera&>(camera);
    new (self) SafeOdometry(plain, dataset::with_camera_height(config, {}), {});
  } else {
    throw nb::type_error("camera: expected Camera, Recording or FrameView");
  }
}

}  // namespace

void bind_odometry(nb::module_& module) {
  bind_camera(module);
  bind_options(module);
  bind_result(module);
  nb::class_<SafeOdometry>(module, "Odometry", "Images in, poses out, one at a time")
      .def("__init__", &make_odometry, "camera"_a, "options"_a = nb::none(),
           nb::sig("def __init__(self, camera: Camera | Recording | FrameView, "
                   "options: Options | dict[str, typing.Any] | None = None) -> None"),
           "A Recording or a FrameView brings its mask and its camera's height with it")
      .def_prop_ro("scale_source", &SafeOdometry::scale_source,
                   "scale.source; 'none': the path is up to scale")
      .def("process", &SafeOdometry::process, "image"_a.noconvert(), "timestamp"_a,
           "HxW gray or HxWx3 RGB, uint8, not copied; seconds, each later than the last")
      .def("landmarks", &SafeOdometry::landmarks,
           "Nx3 in the world, and Nx3 colours: well seen ones, placed by the trajectory")
      .def("tracked_points", &SafeOdometry::tracked_points,
           "Of the last image: Nx4 (u, v before; u, v now), and N: fits the motion")
      .def("channel_image", &SafeOdometry::channel_image,
           "What points of the last image were tracked on");
}

}  // namespace stemvo::python
