// SPDX-License-Identifier: MIT
// Odometry: the library's asynchronous one in Python.
#include <atomic>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <nanobind/eigen/dense.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "frames.hpp"
#include "options.hpp"
#include "options/visit.hpp"
#include "stemvo/async_odometry.hpp"

namespace stemvo::python {
namespace {

using namespace nb::literals;

FrameHints hints_of(const std::optional<GivenArray>& mask, const nb::object& rotation_hint) {
  FrameHints hints;
  if (mask) {
    hints.mask = value_or_raise(mask_of(*mask));
  }
  if (!rotation_hint.is_none()) {
    Eigen::Matrix3d rotation;
    if (!nb::try_cast(rotation_hint, rotation) || !is_rotation(rotation)) {
      throw nb::value_error("rotation_hint: expected a rotation, 3x3, found none");
    }
    hints.prev_from_cur = Eigen::Quaterniond(rotation);
  }
  return hints;
}

/// Without the interpreter's lock.
template <typename F>
std::invoke_result_t<F> unlocked(F f) {
  const nb::gil_scoped_release release;
  return f();
}

/// Frames are pushed and their results taken; Python may call from several threads.
class PythonOdometry {
  /// The value, or a ValueError, of what no other thread does meanwhile.
  template <typename F>
  auto in_turn(F f) {
    return value_or_raise(unlocked([&] {
      const std::scoped_lock lock(mutex_);
      return f();
    }));
  }

 public:
  using Mask = std::optional<GivenArray>;

  PythonOdometry(const Camera& camera, const Config& config, const cv::Mat& mask)
      : scale_source_(options::to_string(config.scale.source)),
        odometry_(create(camera, config, mask)) {
    odometry_.set_log([this](LogLevel level, const std::string& line) {
      const std::scoped_lock lock(log_mutex_);
      log_.emplace_back(level, line);
    });
  }

  /// As metrics.json has it.
  [[nodiscard]] std::string scale_source() const {
    return !has_ways_ || !is_measured_ ? scale_source_
           : scale_source_ == "none"   ? "speed"
                                       : scale_source_ + " and speed";
  }

  FrameResult process(const GivenArray& image,
                      double timestamp,
                      const Mask& mask,
                      const nb::object& rotation_hint) {
    const ImageView view = value_or_raise(view_of(image, "image"));
    const FrameHints hints = hints_of(mask, rotation_hint);
    FrameResult result = in_turn([&]() -> Expected<FrameResult> {
      if (Status status = check_idle("process"); !status) {
        return status.error();
      }
      if (Status status = push_frame(view, timestamp, hints); !status) {
        return status.error();
      }
      return take_result();
    });
    tell();
    return result;
  }
  void push(const GivenArray& image,
            double timestamp,
            const Mask& mask,
            const nb::object& rotation_hint) {
    const ImageView view = value_or_raise(view_of(image, "image"));
    const FrameHints hints = hints_of(mask, rotation_hint);
    in_turn([&] { return push_frame(view, timestamp, hints); });
  }
  FrameResult take() {
    FrameResult result = in_turn([&] { return take_result(); });
    tell();
    return result;
  }
  /// Frames pushed whose results were not taken.
  int num_at_work() {
    return in_turn([&]() -> Expected<int> { return num_at_work_; });
  }
  void add_speed(double time_s, double metres_per_s, std::optional<double> sigma) {
    in_turn([&] { return odometry_.add_speed(time_s, metres_per_s, sigma); });
    has_ways_ = true;
  }
  void add_distance(double from_s, double to_s, double metres, double sigma) {
    in_turn([&] { return odometry_.add_distance(from_s, to_s, metres, sigma); });
    has_ways_ = true;
  }
  void reset() {
    in_turn([&] { return check_idle("reset").and_then([&] { return odometry_.reset(); }); });
    has_ways_ = is_measured_ = false;
  }

  AdjustedMap adjust_map(const std::vector<int>& covariance_of) const {
    return value_or_raise(unlocked([&] { return odometry_.adjust_map(covariance_of); }));
  }
  void save_map(const std::filesystem::path& file) const {
    value_or_raise(unlocked([&] { return odometry_.save_map(file); }));
  }
  void load_map(const std::filesystem::path& file) {
    in_turn([&] { return odometry_.load_map(file); });
  }

  MapChanges landmarks_since(int version) const {
    return unlocked([&] { return odometry_.landmarks_since(version); });
  }
  std::pair<DoubleArray, ByteArray> landmarks() const {
    return arrays_of(landmarks_since(0).landmarks);
  }
  std::vector<MapKeyframe> keyframes(int first) const {
    return unlocked([&] { return odometry_.keyframes(first); });
  }
  std::pair<DoubleArray, BoolArray> tracked_points() {
    return arrays_of(unlocked([&] { return odometry_.tracked_points(); }));
  }
  ByteArray channel_image() {
    return array_of(unlocked([&] { return odometry_.channel_image(); }));
  }

 private:
  static AsyncOdometry create(const Camera& camera, const Config& config, const cv::Mat& mask) {
    return value_or_raise(unlocked([&] { return AsyncOdometry::create(camera, config, mask); }));
  }
  Status push_frame(const ImageView& view, double timestamp, const FrameHints& hints) {
    Status status = odometry_.push(view.pixels, view.order, timestamp, hints);
    num_at_work_ += status ? 1 : 0;
    return status;
  }
  Expected<FrameResult> take_result() {
    auto result = odometry_.next();
    if (!result) {
      num_at_work_ = 0;
      return odometry_.finish().and_then([&] { return Expected<FrameResult>(result.error()); });
    }
    --num_at_work_;
    is_measured_ = is_measured_ || result->value().scale_state == ScaleState::kMeasured;
    return result->value();
  }
  /// Hands over what was logged. The threads that log never wait for the interpreter's lock.
  void tell() {
    std::vector<std::pair<LogLevel, std::string>> lines;
    {
      const std::scoped_lock lock(log_mutex_);
      lines.swap(log_);
    }
    for (const auto& [level, line] : lines) {
      nb::module_::import_("logging").attr("getLogger")("stemvo").attr(
          level == LogLevel::kWarning ? "warning" : "info")(line);
    }
  }
  [[nodiscard]] Status check_idle(const char* name) const {
    return num_at_work_ == 0
               ? Status()
               : fail(fmt::format("{}: expected a run that is over, found one with {} frames "
                                  "at work",
                                  name, num_at_work_));
  }

  std::string scale_source_;
  std::atomic<bool> has_ways_ = false;     ///< a speed or a distance was added
  std::atomic<bool> is_measured_ = false;  ///< a frame's scale was
  std::mutex mutex_;
  int num_at_work_ = 0;
  std::mutex log_mutex_;
  std::vector<std::pair<LogLevel, std::string>> log_;
  AsyncOdometry odometry_;  ///< last, so that its threads end first
};

void make_odometry(PythonOdometry* self,
                   const nb::object& camera,
                   const nb::object& options,
                   const std::optional<GivenArray>& mask) {
  const Config config = config_of(options);
  if (config.scale_choice == ScaleChoice::kGroundTruth) {
    throw nb::value_error(
        "scale.source: expected none, constant_speed or camera_height, found ground_truth");
  }
  const cv::Mat given = mask ? value_or_raise(mask_of(*mask)) : cv::Mat();
  if (const FrameSource* frames = frames_of(camera)) {
    new (self) PythonOdometry(frames->camera, dataset::with_camera_height(config, *frames),
                              mask ? given : frames->mask);
  } else if (nb::isinstance<Camera>(camera)) {
    const Camera& plain = nb::cast<const Camera&>(camera);
    new (self) PythonOdometry(plain, dataset::with_camera_height(config, {}), given);
  } else {
    throw nb::value_error("camera: expected Camera, Recording or FrameView");
  }
}

}  // namespace

void bind_odometry(nb::module_& module) {
  // stemvo.Odometry, which has run(), is made of it.
  nb::class_<PythonOdometry>(module, "Odometry")
      .def("__init__", &make_odometry, "camera"_a, "options"_a = nb::none(), "mask"_a = nb::none(),
           nb::sig("def __init__(self, camera: Camera | Recording | FrameView, "
                   "options: Options | dict[str, typing.Any] | None = None, "
                   "mask: numpy.typing.NDArray[numpy.uint8 | numpy.bool_] | None = None) -> None"),
           "A Recording or a FrameView brings its mask and its camera's height with it")
      .def_prop_ro(
          "scale_source", &PythonOdometry::scale_source,
          "As in metrics.json; 'none': the path is up to scale; 'speed': metres by add_speed")
      .def("process", &PythonOdometry::process, "image"_a.none(), "timestamp"_a,
           "mask"_a = nb::none(), "rotation_hint"_a = nb::none(),
           "HxW gray or HxWx3 RGB, uint8; seconds, each later than the last. mask: HxW uint8 or "
           "bool, 0 "
           "where this frame shows what moves; rotation_hint: 3x3, since the last frame, from the "
           "camera now to the camera then")
      .def("_push", &PythonOdometry::push, "image"_a.none(), "timestamp"_a, "mask"_a = nb::none(),
           "rotation_hint"_a = nb::none())
      .def("_take", &PythonOdometry::take)
      .def_prop_ro("_num_at_work", &PythonOdometry::num_at_work)
      .def("reset", &PythonOdometry::reset,
           "A new world: same network, camera and options; times may begin anew")
      .def("add_speed", &PythonOdometry::add_speed, "timestamp"_a, "metres_per_s"_a,
           "sigma"_a = nb::none(),
           "Of the camera along its path, as wheels or GPS tell it; metres from then on. sigma: "
           "None: 2 % of it, at least 0.05 m/s")
      .def("add_distance", &PythonOdometry::add_distance, "begin"_a, "end"_a, "metres"_a, "sigma"_a,
           "The camera's way between two times, likewise")
      .def("adjust_map", &PythonOdometry::adjust_map, "covariance_of"_a = std::vector<int>(),
           "All frames so far at once; covariance_of: frames of keyframes")
      .def("save_map", &PythonOdometry::save_map, "file"_a, "Adjusted, for load_map")
      .def("load_map", &PythonOdometry::load_map, "file"_a,
           "Before the first frame: its places are recognized from then on")
      .def("landmarks", &PythonOdometry::landmarks,
           "Nx3 in the world, and Nx3 colours: well seen ones, placed by the trajectory")
      .def("landmarks_since", &PythonOdometry::landmarks_since, "version"_a,
           "Those that came, moved or went since that version of the map; 0: all")
      .def("keyframes", &PythonOdometry::keyframes, "first"_a = 0, "Those from this id on")
      .def("tracked_points", &PythonOdometry::tracked_points,
           "Of the last image: Nx4 (u, v before; u, v now), and N: fits the motion")
      .def("channel_image", &PythonOdometry::channel_image,
           "What points of the last image were tracked on");
}

}  // namespace stemvo::python
