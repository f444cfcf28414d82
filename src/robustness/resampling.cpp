// SPDX-License-Identifier: MIT
#include <cmath>
#include <numeric>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "robustness/disturbance.hpp"

namespace stemvo::robustness {
namespace {

/// Frames `shown[i]` of the source, at the time and place of frames `kept[i]`.
FrameSource take(const FrameSource& source,
                 const std::vector<std::size_t>& kept,
                 std::vector<std::size_t> shown) {
  const FrameSource& all = source;
  FrameSource frames = all;
  frames.files.clear();
  frames.timestamps_s.clear();
  for (std::size_t i = 0; i < kept.size(); ++i) {
    frames.files.push_back(all.files[shown[i]]);
    frames.timestamps_s.push_back(all.timestamps_s[kept[i]]);
  }
  if (all.ground_truth) {
    frames.ground_truth->clear();
    for (const std::size_t index : kept) {
      frames.ground_truth->push_back((*all.ground_truth)[index]);
    }
  }
  frames.range.end = frames.range.begin + kept.size();
  frames.read = [read = all.read, shown = std::move(shown)](std::size_t index) {
    return read(shown[index]);
  };
  return frames;
}

bool falls_out(std::size_t frame, double share, std::uint64_t seed) {
  return frame > 0 && random_of(seed, frame).uniform(0.0, 1.0) < share;
}

/// Another camera's frames: `part` of the image, resized by `factor`.
FrameSource with_camera(const FrameSource& source, const cv::Rect& part, double factor) {
  FrameSource frames = source;
  const cv::Size size(static_cast<int>(std::lround(factor * part.width)),
                      static_cast<int>(std::lround(factor * part.height)));
  const double x = static_cast<double>(size.width) / part.width;
  const double y = static_cast<double>(size.height) / part.height;
  const Camera& old = source.camera;
  frames.camera = {old.fx_px * x,
                   old.fy_px * y,
                   (old.cx_px - part.x + 0.5) * x - 0.5,
                   (old.cy_px - part.y + 0.5) * y - 0.5,
                   size.width,
                   size.height};
  frames.read = [read = frames.read, part, size](std::size_t index) {
    return read(index).map([&](const cv::Mat& image) {
      cv::Mat result = image(part).clone();
      if (size != part.size()) {
        cv::resize(image(part), result, size, 0.0, 0.0, cv::INTER_AREA);
      }
      return result;
    });
  };
  return frames;
}

FrameSource dropped(const FrameSource& source, double share, std::uint64_t seed) {
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < source.size(); ++i) {
    if (!falls_out(i, share, seed)) {
      kept.push_back(i);
    }
  }
  return take(source, kept, kept);
}

FrameSource repeated(const FrameSource& source, double share, std::uint64_t seed) {
  std::vector<std::size_t> all(source.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::vector<std::size_t> shown = all;
  for (std::size_t i = 1; i < shown.size(); ++i) {
    shown[i] = falls_out(i, share, seed) ? shown[i - 1] : i;
  }
  return take(source, all, shown);
}

FrameSource every_nth(const FrameSource& source, double step, std::uint64_t /*seed*/) {
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < source.size(); i += static_cast<std::size_t>(step)) {
    kept.push_back(i);
  }
  return take(source, kept, kept);
}

FrameSource cropped(const FrameSource& source, double share, std::uint64_t /*seed*/) {
  const Camera& camera = source.camera;
  const int width = static_cast<int>(share * camera.width_px);
  const int height = static_cast<int>(share * camera.height_px);
  return with_camera(
      source, {(camera.width_px - width) / 2, (camera.height_px - height) / 2, width, height}, 1.0);
}

FrameSource scaled(const FrameSource& source, double factor, std::uint64_t /*seed*/) {
  return with_camera(source, {0, 0, source.camera.width_px, source.camera.height_px}, factor);
}

}  // namespace

std::vector<Disturbance> resamplings() {
  return {
      {"dropped",
       "other frames",
       "this share of the frames is missing",
       {0.05, 0.1, 0.2},
       nullptr,
       dropped},
      {"repeated",
       "other frames",
       "this share of the frames shows the one before",
       {0.05, 0.1, 0.2},
       nullptr,
       repeated},
      {"every_nth",
       "other frames",
       "only every so many frames",
       {2.0, 3.0, 5.0},
       nullptr,
       every_nth},
      {"cropped",
       "other views",
       "only the middle of the image, this share of its sides",
       {0.8, 0.6, 0.4},
       nullptr,
       cropped},
      {"scaled",
       "other views",
       "the image made smaller by this factor",
       {0.75, 0.5, 0.35},
       nullptr,
       scaled},
  };
}

}  // namespace stemvo::robustness
