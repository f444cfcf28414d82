// SPDX-License-Identifier: MIT
#include "stages/drive.hpp"

#include <algorithm>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <unistd.h>

#include "odometry/road/image.hpp"
#include "synth/synth.hpp"

namespace stemvo::bench {
namespace {

/// More than the window of keyframes: the map is as large as it gets.
constexpr int kNumFrames = 14;

template <typename T>
T value_of(Expected<T> result) {
  if (!result) {
    throw std::runtime_error(result.error().message);
  }
  return std::move(*result);
}

/// A folder that is removed when the program ends.
class Folder {
 public:
  Folder()
      : path_(std::filesystem::temp_directory_path() / fmt::format("stemvo_bench_{}", ::getpid())) {
    std::filesystem::create_directories(path_);
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

Frames load_frames() {
  static const Folder folder;
  const char* given = std::getenv("STEMVO_BENCH_SEQUENCE");
  std::filesystem::path sequence = given != nullptr ? given : "";
  if (sequence.empty()) {
    SyntheticDriveOptions options;
    options.num_frames = kNumFrames;
    if (const Status rendered = render_synthetic_drive(folder.path() / "drive", options);
        !rendered) {
      throw std::runtime_error(rendered.error().message);
    }
    sequence = folder.path() / "drive/sequences/00";
  }
  SequenceOptions options;
  options.frames = FrameRangeRequest{0, kNumFrames};
  Frames frames{folder.path(), value_of(open_kitti(sequence, options)), {}, false};
  for (std::size_t i = 0; i < frames.sequence.size(); ++i) {
    frames.pixels.push_back(value_of(frames.sequence.read(i)));
  }
  frames.is_color = frames.pixels.front().channels() == 3;
  return frames;
}

/// As ChannelOdometry does it; the last frame is not localized.
Chain run_chain() {
  Chain result;
  result.camera = frames().sequence.camera;
  result.config = dataset::with_camera_height({}, frames().sequence);
  const Config& config = result.config;
  const Stem stem = load_stem(config.stem);
  ContrastNormalization contrast(config.stem);
  ContrastNormalization road_contrast({.tracking_resolution = TrackingResolution::kNative});
  const auto front_end = create_front_end(config.features);
  result.estimator = std::make_unique<WindowEstimator>(config, result.camera);
  const int last = static_cast<int>(frames().pixels.size()) - 1;
  for (int i = 0; i <= last; ++i) {
    const cv::Mat& pixels = frames().pixels[static_cast<std::size_t>(i)];
    result.channel = value_of(stem.apply(pixels));
    result.images.push_back(contrast.apply(result.channel));
    Frame frame;
    frame.number = i;
    frame.time_s = frames().sequence.time_s(static_cast<std::size_t>(i));
    frame.image = pixels;
    const ChannelImage road = road_contrast.apply(road_channel(pixels, result.camera));
    frame.road = std::make_shared<RoadImage>(make_road_image(road, result.camera));
    frame.matches =
        front_end->process(front_end->prepare(result.images.back(), {}), {i, frame.time_s});
    if (i == last) {
      result.matches = frame.matches;
      result.last = std::move(frame);
      break;
    }
    LocalizedFrame localized = result.estimator->localize(frame);
    front_end->remove_outliers(localized.inlier_mask);
    result.estimator->optimize(frame, localized);
  }
  return result;
}

}  // namespace

Stem load_stem(const StemOptions& options) { return value_of(Stem::load(options)); }

const Frames& frames() {
  static const Frames result = load_frames();
  return result;
}

const Chain& chain() {
  static const Chain result = run_chain();
  return result;
}

}  // namespace stemvo::bench
