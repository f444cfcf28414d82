// SPDX-License-Identifier: MIT
// Parts of an odometry, for studies that run many channels over one image.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "frames.hpp"
#include "odometry/channel_odometry.hpp"
#include "odometry/check_frame.hpp"
#include "options.hpp"
#include "stem/model.hpp"
#include "stem/stem.hpp"

namespace stemvo::python {
namespace {

using namespace nb::literals;
using FloatArray = nb::ndarray<nb::numpy, float, nb::ndim<2>>;
using FloatArgument = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

/// One per filter asked for; each shares its memory with the arrays made of it.
using Channels = std::vector<Channel>;

Channel channel_of(const FloatArgument& values, double scale, double offset) {
  constexpr int kMinSide = 16;
  const cv::Mat view(static_cast<int>(values.shape(0)), static_cast<int>(values.shape(1)), CV_32F,
                     const_cast<float*>(values.data()));
  if (std::min(view.rows, view.cols) < kMinSide || !cv::checkRange(view)) {
    throw nb::value_error(fmt::format("values: expected finite numbers, at least {0}x{0}, found "
                                      "{1}x{2}{3}",
                                      kMinSide, view.rows, view.cols,
                                      view.empty() || cv::checkRange(view) ? "" : ", not finite")
                              .c_str());
  }
  if (!(scale > 0.0 && std::isfinite(scale) && std::isfinite(offset))) {
    throw nb::value_error(
        fmt::format("scale, offset: expected a scale above 0 and a number, found {}, {}", scale,
                    offset)
            .c_str());
  }
  return {view.clone(), {{scale, scale}, {offset, offset}}};
}

/// `owner`: the Python object that keeps the pixels alive.
FloatArray values_of(nb::handle owner) {
  const Channel& channel = nb::cast<const Channel&>(owner);
  const cv::Mat& mat = channel.values;
  const auto columns = static_cast<std::int64_t>(mat.step1());
  return {const_cast<float*>(mat.ptr<float>()),
          {static_cast<std::size_t>(mat.rows), static_cast<std::size_t>(mat.cols)},
          owner,
          {columns, 1}};
}

/// All filters of a layer.
class PythonStem {
 public:
  explicit PythonStem(const Config& config)
      : resolution_(config.stem.tracking_resolution),
        method_(config.features.method),
        stem_(value_or_raise([&] {
          const nb::gil_scoped_release release;
          return Stem::load_all(config.stem);
        }())) {}

  [[nodiscard]] const StemInfo& info() const { return stem_.info(); }

  /// Filters [first, last) as an odometry of this camera's frames takes them.
  Channels apply(const GivenArray& image,
                 const Camera& camera,
                 int first,
                 std::optional<int> last) {
    const ImageView view = value_or_raise(view_of(image, "image"));
    const int end = last.value_or(info().num_filters);
    if (first < 0 || first >= end || end > info().num_filters) {
      throw nb::value_error(fmt::format("first, last: expected filters inside 0:{}, found {}:{}",
                                        info().num_filters, first, end)
                                .c_str());
    }
    auto channels = [&] {
      const nb::gil_scoped_release release;
      const auto resolution = choose_tracking_resolution(resolution_, method_, camera);
      return stem_.apply_range(view.pixels, first, end, stem_.frame_zoom(resolution));
    }();
    return value_or_raise(std::move(channels));
  }

 private:
  TrackingResolution resolution_;
  FeatureMethod method_;
  Stem stem_;
};

/// The odometry behind the stem; threads wait for each other.
class PythonChannelOdometry {
 public:
  PythonChannelOdometry(const nb::object& camera, const nb::object& options) {
    Config config = config_of(options);
    config.threads = 1;
    has_map_ = config.odometry.mode == OdometryMode::kMap;
    const FrameSource* frames = frames_of(camera);
    const Camera& seen_by = frames != nullptr ? frames->camera : nb::cast<Camera>(camera);
    value_or_raise(check_camera(seen_by));
    size_ = {seen_by.width_px, seen_by.height_px};
    odometry_.emplace(config, seen_by, frames != nullptr ? frames->mask : cv::Mat());
  }

  FrameResult process(const Channel* channel,
                      const std::optional<GivenArray>& image,
                      double timestamp) {
    const cv::Mat pixels = image ? value_or_raise(view_of(*image, "image")).pixels : cv::Mat();
    if (image && pixels.size() != size_) {
      throw nb::value_error(fmt::format("image: expected {}x{} pixels, found {}x{}", size_.width,
                                        size_.height, pixels.cols, pixels.rows)
                                .c_str());
    }
    const nb::gil_scoped_release release;
    const std::lock_guard lock(turn_);
    if (!(timestamp > last_time_s_)) {
      throw std::invalid_argument(
          fmt::format("timestamp: expected more than {}, found {}", last_time_s_, timestamp));
    }
    last_time_s_ = timestamp;
    Frame frame;
    frame.time_s = timestamp;
    if (channel != nullptr && !pixels.empty()) {
      // Pairs of frames have no landmarks that take their colour from it later.
      frame = odometry_->prepare(*channel, has_map_ ? pixels.clone() : pixels, timestamp);
    }
    return odometry_->process(std::move(frame));
  }
  [[nodiscard]] DoubleArray trajectory() {
    const nb::gil_scoped_release release;
    const std::lock_guard lock(turn_);
    const nb::gil_scoped_acquire acquire;
    return array_of(std::span<const Rigid3>(odometry_->estimator().trajectory()));
  }

 private:
  bool has_map_ = true;
  cv::Size size_;
  std::mutex turn_;  ///< of process()
  std::optional<ChannelOdometry> odometry_;
  double last_time_s_ = -std::numeric_limits<double>::infinity();
};

nb::bytes model_bytes(const std::string& model) {
  const std::string bytes = is_hand_made(model) ? model : value_or_raise(read_model(model));
  return nb::bytes(bytes.data(), bytes.size());
}

void bind_channels(nb::module_& module) {
  nb::class_<Channel>(module, "Channel", "A filter's response to an image")
      .def(
          "__init__",
          [](Channel* self, const FloatArgument& values, double scale, double offset) {
            new (self) Channel(channel_of(values, scale, offset));
          },
          "values"_a, "scale"_a = 1.0, "offset"_a = 0.0,
          "HxW float32, copied; pixel u of it lies at scale * u + offset in the image")
      .def_prop_ro("values", &values_of, "HxW float32, the channel's own memory")
      .def_prop_ro("scale", [](const Channel& c) { return c.map.scale.x(); })
      .def_prop_ro("offset", [](const Channel& c) { return c.map.offset_px.x(); });
  nb::class_<PythonStem>(module, "Stem", "All filters of a layer, of `stem.model`")
      .def(
          "__init__",
          [](PythonStem* self, const nb::object& options) {
            new (self) PythonStem(config_of(options));
          },
          "options"_a = nb::none())
      .def_prop_ro("num_filters", [](const PythonStem& s) { return s.info().num_filters; })
      .def_prop_ro("layer", [](const PythonStem& s) { return s.info().layer; })
      .def_prop_ro("sampling_px", [](const PythonStem& s) { return s.info().sampling_px; })
      .def("apply", &PythonStem::apply, "image"_a.noconvert(), "camera"_a, "first"_a = 0,
           "last"_a = nb::none(),
           "Channels of the filters from `first` up to `last`, from one pass over the image");
  module.def("model_bytes", &model_bytes, "model"_a, "A model's file");
  module.def(
      "model_stride",
      [](const std::string& model) {
        if (is_hand_made(model)) {
          return std::pair(1, true);
        }
        const ModelInfo info = value_or_raise(read_model_info(model));
        return std::pair(info.stride_px, info.native_sampling_only);
      },
      "model"_a, "A layer's stride, and whether it is sampled by that alone");
}

}  // namespace

void bind_studies(nb::module_& module) {
  bind_channels(module);
  nb::class_<PythonChannelOdometry>(module, "ChannelOdometry",
                                    "An odometry whose channels come from elsewhere: many of them "
                                    "share one stem. Works in the thread that calls it")
      .def(nb::init<const nb::object&, const nb::object&>(), "camera"_a, "options"_a = nb::none(),
           "Camera, Recording or FrameView; stem.model and stem.filter are not used")
      .def("process", &PythonChannelOdometry::process, "channel"_a.none(),
           "image"_a.noconvert().none(), "timestamp"_a,
           "Image as Odometry takes it; None for one that could not be read, or seen")
      .def_prop_ro("trajectory", &PythonChannelOdometry::trajectory, nb::rv_policy::move,
                   "Nx4x4, world_from_camera of all frames so far");
  module.def(
      "set_num_threads", [](int number) { cv::setNumThreads(number); }, "number"_a,
      "Of OpenCV, in this process");
}

}  // namespace stemvo::python
