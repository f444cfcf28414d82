// SPDX-License-Identifier: MIT
// Recordings: the program's readers in Python.
#include <algorithm>
#include <filesystem>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "dataset/frame_files.hpp"
#include "frames.hpp"

namespace stemvo {

/// In place of video_stream.cpp: OpenCV's videoio would bring FFmpeg and GDAL into the package.
Expected<FrameSource> dataset::open_video(const FrameSourceRequest& request) {
  return fail(fmt::format(
      "{}: expected a folder or a pattern of images, found a video or a camera; read it with cv2 "
      "and stemvo.FrameView (docs/python.md)",
      request.sequence_dir.string()));
}

namespace python {

const FrameSource* frames_of(nb::handle object) {
  const FrameSource* source = nullptr;
  const CameraView* view = nullptr;
  return nb::try_cast(object, source) && source != nullptr ? &*source
         : nb::try_cast(object, view) && view != nullptr   ? &view->frames
                                                           : nullptr;
}

namespace {

using namespace nb::literals;
using Path = std::filesystem::path;

void warn(const std::string& text) {
  if (PyErr_WarnEx(PyExc_RuntimeWarning, text.c_str(), 1) != 0) {
    throw nb::python_error();
  }
}

FrameSource open_recording(const Path& path,
                           const std::optional<Path>& camera_file,
                           const std::optional<std::string>& frames,
                           const std::optional<Path>& ground_truth,
                           double tolerance_s,
                           const std::optional<Path>& times,
                           const std::optional<double>& rate,
                           const std::optional<Path>& calibration,
                           const std::vector<std::string>& masks,
                           const std::string& input_camera) {
  FrameSourceRequest request;
  request.sequence_dir = path;
  request.camera_file = camera_file;
  if (frames) {
    request.frames = value_or_raise(parse_frame_range(*frames));
  }
  request.ground_truth = ground_truth;
  request.ground_truth_tolerance_s = tolerance_s;
  request.times = times;
  request.rate_hz = rate;
  request.calibration = calibration;
  request.masks = masks;
  request.camera = input_camera;
  auto opened = [&] {
    const nb::gil_scoped_release release;
    return open_source(request);
  }();
  FrameSource source = value_or_raise(std::move(opened));
  for (const auto* lines : {&source.notes, &source.warnings}) {
    std::ranges::for_each(*lines, [](const std::string& line) { warn(in_python(line)); });
  }
  return source;
}

/// As for the program, an image that cannot be read is a warning; None stands for it.
nb::tuple frame_of(const FrameSource& source, std::size_t index) {
  if (index >= source.size()) {
    throw nb::index_error("frame: behind the last");
  }
  const auto image = [&] {
    const nb::gil_scoped_release release;
    return source.read(index);
  }();
  if (image) {
    return nb::make_tuple(array_of(*image), source.time_s(index));
  }
  warn(image.error().message);
  return nb::make_tuple(nb::none(), source.time_s(index));
}

nb::object truth_of(const FrameSource& source) {
  const auto& truth = source.ground_truth;
  return truth ? nb::cast(array_of(truth->poses)) : nb::none();
}

nb::object truth_frames_of(const FrameSource& source) {
  const auto truth = value_or_raise(source.ground_truth_of(source.size()));
  return truth ? nb::cast(array_of(truth->frames)) : nb::none();
}

CameraView view_of_file(const Path& camera_file, const std::vector<std::string>& masks) {
  const auto camera = value_or_raise(dataset::read_camera_file(camera_file));
  CameraView made;
  made.frames.warnings = camera.warnings;
  made.view = value_or_raise(dataset::add_view(made.frames, camera, camera_file, masks, {}));
  for (const std::string& warning : made.frames.warnings) {
    warn(warning);
  }
  return made;
}

ByteArray apply(const CameraView& made, const GivenArray& image) {
  const ImageView given = value_or_raise(view_of(image, "image"));
  const cv::Size size = made.view.full_size();
  if (given.pixels.size() != size) {
    throw nb::value_error(fmt::format("image: expected {}x{} pixels, as the camera file says, "
                                      "found {}x{}",
                                      size.width, size.height, given.pixels.cols, given.pixels.rows)
                              .c_str());
  }
  const cv::Mat seen = [&] {
    const nb::gil_scoped_release release;
    return made.view.apply(given.pixels);
  }();
  return array_of(seen);
}

void bind_recording(nb::module_& module) {
  nb::class_<FrameSource>(module, "Recording",
                          "Frames of a folder: `for image, timestamp in recording`")
      .def("__len__", &FrameSource::size)
      .def("__getitem__", &frame_of, "index"_a,
           nb::sig("def __getitem__(self, index: int) -> "
                   "tuple[numpy.typing.NDArray[numpy.uint8] | None, float]"),
           "Image (RGB, or gray) and time; None and a warning: it cannot be read")
      .def(
          "__iter__", [](nb::handle self) { return nb::steal(PySeqIter_New(self.ptr())); },
          nb::sig("def __iter__(self) -> collections.abc.Iterator["
                  "tuple[numpy.typing.NDArray[numpy.uint8] | None, float]]"))
      .def("__repr__",
           [](const FrameSource& s) {
             return fmt::format("Recording({} frames, {}x{})", s.size(), s.camera.width_px,
                                s.camera.height_px);
           })
      .def_prop_ro("camera", [](const FrameSource& s) { return s.camera; })
      .def_prop_ro("camera_height_m", [](const FrameSource& s) { return s.camera_height_m; })
      .def_prop_ro(
          "timestamps", [](const FrameSource& s) { return array_of(s.timestamps_s); },
          nb::rv_policy::move)
      .def_prop_ro("ground_truth", &truth_of,
                   nb::sig("def ground_truth(self) -> numpy.typing.NDArray[numpy.float64] | None"),
                   "Nx4x4 of the frames that have a true pose")
      .def_prop_ro(
          "ground_truth_frames", &truth_frames_of,
          nb::sig("def ground_truth_frames(self) -> numpy.typing.NDArray[numpy.int64] | None"),
          "N: which frames these are, counted from the recording's first");
  module.def(
      "read_recording", &open_recording, "path"_a, "camera_file"_a = nb::none(), nb::kw_only(),
      "frames"_a = nb::none(), "ground_truth"_a = nb::none(), "tolerance_s"_a = kTimeTolerance_s,
      "times"_a = nb::none(), "rate"_a = nb::none(), "calibration"_a = nb::none(),
      "masks"_a = std::vector<std::string>(), "input_camera"_a = "auto",
      "What `stemvo run` reads, but for videos and live cameras; as its --frames 'A:B', --gt, "
      "--gt-tolerance, --times, --rate, --calib, --mask and the key input.camera");
}

}  // namespace

void bind_recordings(nb::module_& module) {
  bind_recording(module);
  nb::class_<CameraView>(
      module, "FrameView",
      "What a camera file makes of frames: undistorted, at most of the size that "
      "is worked on, as `stemvo run` sees them")
      .def(
          "__init__",
          [](CameraView* self, const Path& camera_file, const std::vector<std::string>& masks) {
            new (self) CameraView(view_of_file(camera_file, masks));
          },
          "camera_file"_a, "masks"_a = std::vector<std::string>())
      .def("apply", &apply, "image"_a.none(), "HxW gray or HxWx3 RGB, uint8; a new array")
      .def_prop_ro("camera", [](const CameraView& v) { return v.frames.camera; })
      .def_prop_ro("camera_height_m", [](const CameraView& v) { return v.frames.camera_height_m; });
}

}  // namespace python
}  // namespace stemvo
