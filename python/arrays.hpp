// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <string>
#include <utility>

#include <Eigen/Core>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <opencv2/core.hpp>

#include "evaluation/trajectory.hpp"
#include "stemvo/error.hpp"
#include "stemvo/odometry.hpp"

namespace stemvo::python {

namespace nb = nanobind;

using AnyArray = nb::ndarray<nb::ro, nb::device::cpu>;
/// What was given as an array, whatever it is: what takes it says what is wrong with it.
struct GivenArray {
  AnyArray array;  ///< invalid: it is none
  std::string type;
};
using DoubleArray = nb::ndarray<nb::numpy, double>;
using ByteArray = nb::ndarray<nb::numpy, std::uint8_t>;
using BoolArray = nb::ndarray<nb::numpy, bool>;
using IndexArray = nb::ndarray<nb::numpy, std::int64_t>;

/// The library's message with the arguments of Python in place of the program's options.
[[nodiscard]] std::string in_python(std::string message);

/// The value, or a ValueError with the library's message. The GIL is held.
template <typename T>
T value_or_raise(Expected<T> result) {
  if (!result) {
    throw nb::value_error(in_python(result.error().message).c_str());
  }
  if constexpr (!std::is_void_v<T>) {
    return *std::move(result);
  }
}

struct ImageView {
  cv::Mat pixels;  ///< the array's own
  PixelOrder order = PixelOrder::kGray;
};
/// HxW or HxWx3 uint8 whose rows may lie apart (a cropped view) but whose pixels may not. Else an
/// error that calls it `name`.
[[nodiscard]] Expected<ImageView> view_of(const GivenArray& given, const char* name);
/// HxW uint8 or bool.
[[nodiscard]] Expected<cv::Mat> mask_of(const GivenArray& given);
/// A copy, HxW or HxWx3.
[[nodiscard]] ByteArray array_of(const cv::Mat& image);

[[nodiscard]] bool is_rotation(const Eigen::Matrix3d& matrix);  ///< false: NaN
/// Nx4x4 or Nx3x4 float64, each a rigid motion. Else an error that calls it `name`.
[[nodiscard]] Expected<Trajectory> trajectory_of(const GivenArray& given, const std::string& name);
[[nodiscard]] DoubleArray array_of(const Rigid3& pose);                  ///< 4x4
[[nodiscard]] DoubleArray array_of(std::span<const Rigid3> trajectory);  ///< Nx4x4
[[nodiscard]] DoubleArray array_of(std::span<const double> numbers);
[[nodiscard]] IndexArray array_of(std::span<const std::size_t> indices);
[[nodiscard]] IndexArray array_of(std::span<const int> ids);
/// In the world, Nx3, and their colours, Nx3.
[[nodiscard]] std::pair<DoubleArray, ByteArray> arrays_of(std::span<const MapLandmark> landmarks);
/// Last and present place in the image, Nx4 (u, v, u, v), and whether they fit the motion, N.
[[nodiscard]] std::pair<DoubleArray, BoolArray> arrays_of(std::span<const TrackedPoint> points);

void bind_options(nb::module_& module);
void bind_results(nb::module_& module);
void bind_odometry(nb::module_& module);
void bind_recordings(nb::module_& module);
void bind_evaluation(nb::module_& module);
void bind_studies(nb::module_& module);
void bind_tracking(nb::module_& module);

}  // namespace stemvo::python

template <>
struct nanobind::detail::type_caster<stemvo::python::GivenArray> {
  using Array = make_caster<stemvo::python::AnyArray>;
  NB_TYPE_CASTER(stemvo::python::GivenArray, Array::Name)
  bool from_python(handle from, uint32_t flags, cleanup_list* cleanup) noexcept {
    Array array;
    if (array.from_python(from, flags & ~static_cast<uint32_t>(cast_flags::convert), cleanup)) {
      value.array = array.value;
    }
    value.type = Py_TYPE(from.ptr())->tp_name;
    return true;
  }
};
