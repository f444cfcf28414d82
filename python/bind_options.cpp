// SPDX-License-Identifier: MIT
// Camera and Options: what an odometry is made of.
#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "options.hpp"

namespace stemvo::python {
namespace {

using namespace nb::literals;

/// ValueError: a path of other bytes.
std::string utf8_of(nb::handle value) {
  const nb::str text(value);
  const char* const utf8 = PyUnicode_AsUTF8(text.ptr());
  if (utf8 == nullptr) {
    PyErr_Clear();
    throw nb::value_error(
        fmt::format("options: expected text in UTF-8, found {}", nb::repr(value).c_str()).c_str());
  }
  return utf8;
}

/// As --set takes it.
std::string text_of(nb::handle value) {
  if (value.is_none()) {
    throw nb::value_error("options: expected a value, found None");
  }
  return PyBool_Check(value.ptr()) ? (value.is(Py_True) ? "true" : "false") : utf8_of(value);
}

/// `section`: "" or one's name and a dot.
void set_all(Config& config, const std::string& section, const nb::dict& values) {
  for (const auto& [key, value] : values) {
    const std::string name = section + utf8_of(key);
    if (nb::isinstance<nb::dict>(value)) {  // as `stemvo --dump-config` prints them
      set_all(config, name + ".", nb::cast<nb::dict>(value));
      continue;
    }
    const Status status = apply_override(config, name + "=" + text_of(value));
    if (!status) {
      throw nb::value_error(in_python(status.error().message).c_str());
    }
  }
}

void apply(Config& config, const nb::dict& values) {
  set_all(config, "", values);
  value_or_raise(validate(config));
}

/// `num_coefficients`: those that camera files may have.
struct Lens {
  const char* name;
  std::array<std::ptrdiff_t, 4> num_coefficients;
};
/// By the enumerator's number.
constexpr std::array<Lens, 3> kLenses = {
    {{"none", {}}, {"radial-tangential", {4, 5, 8, 12}}, {"equidistant", {4, 4, 4, 4}}}};

const Lens& lens_of(const Camera& camera) {
  return kLenses.at(static_cast<std::size_t>(camera.distortion));
}

void set_distortion(Camera& camera,
                    const std::string& distortion,
                    const std::vector<double>& coefficients) {
  const auto* const found = std::ranges::find(kLenses, distortion, &Lens::name);
  if (found == kLenses.end() ||
      std::ranges::count(found->num_coefficients, std::ssize(coefficients)) == 0) {
    throw nb::value_error(
        fmt::format("distortion: expected none, radial-tangential with 4, 5, 8 or 12 "
                    "coefficients, or equidistant with 4, found '{}' with {}",
                    distortion, coefficients.size())
            .c_str());
  }
  camera.distortion = static_cast<Distortion>(found - kLenses.begin());
  std::ranges::copy(coefficients, camera.distortion_coefficients.begin());
}

/// As few as set_distortion takes and as hold all that are not 0.
std::vector<double> coefficients_of(const Camera& camera) {
  const auto& all = camera.distortion_coefficients;
  for (const std::ptrdiff_t count : lens_of(camera).num_coefficients) {
    if (std::all_of(all.begin() + count, all.end(), [](double k) { return k == 0.0; })) {
      return {all.begin(), all.begin() + count};
    }
  }
  return {all.begin(), all.end()};
}

std::string describe(const Camera& camera) {
  std::string text =
      fmt::format("Camera(fx={}, fy={}, cx={}, cy={}, width={}, height={}", camera.fx_px,
                  camera.fy_px, camera.cx_px, camera.cy_px, camera.width_px, camera.height_px);
  if (camera.distortion != Distortion::kNone) {
    text += fmt::format(", distortion='{}', coefficients=[{}]", lens_of(camera).name,
                        fmt::join(coefficients_of(camera), ", "));
  }
  return text + ")";
}

void bind_camera(nb::module_& module) {
  nb::class_<Camera>(
      module, "Camera",
      "Pinhole camera, in pixels; distortion is none, radial-tangential (k1 k2 p1 p2, maybe k3, "
      "k4 k5 k6, s1 to s4 behind) or equidistant (k1 k2 k3 k4)")
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
      .def_prop_ro("distortion", [](const Camera& c) { return lens_of(c).name; })
      .def_prop_ro("coefficients", &coefficients_of)
      .def("__repr__", &describe);
}

void bind_options_class(nb::module_& module) {
  nb::class_<Config>(module, "Options", "The keys of `stemvo --dump-config`")
      .def(
          "__init__",
          [](Config* self, const nb::object& values) { new (self) Config(config_of(values)); },
          "values"_a = nb::dict(),
          nb::sig("def __init__(self, values: dict[str, typing.Any] = {}) -> None"),
          "E.g. {'stem.filter': 3}, or {'stem': {'filter': 3}}; ValueError: a bad key or value")
      .def_static(
          "driving",
          [](double height_m) {
            nb::dict values;
            values["scale.source"] = "camera_height";
            values["scale.camera_height_m"] = height_m;
            Config config;
            apply(config, values);
            return config;
          },
          "height_m"_a, "Of a camera on a vehicle, so high above its road: metres")
      .def_static(
          "load",
          [](const std::filesystem::path& file) { return value_or_raise(load_config(file)); },
          "file"_a, "A configuration file of the program")
      .def("__str__", &dump_config, "All keys as YAML");
}

}  // namespace

Config config_of(const nb::object& options) {
  Config config;
  if (nb::isinstance<Config>(options)) {
    config = nb::cast<Config>(options);
  } else if (nb::isinstance<nb::dict>(options)) {
    apply(config, nb::cast<nb::dict>(options));
  } else if (!options.is_none()) {
    throw nb::value_error("options: expected Options or a dict");
  }
  return config;
}

void bind_options(nb::module_& module) {
  bind_camera(module);
  bind_options_class(module);
}

}  // namespace stemvo::python
