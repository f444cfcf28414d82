// SPDX-License-Identifier: MIT
#include "odometry/road/image.hpp"

#include <algorithm>

#include <opencv2/imgproc.hpp>

#include "stem/stem.hpp"

namespace stemvo {
namespace {

/// Reach of the local contrast, input pixels (at half size: its own, twice as wide).
constexpr double kContrast_px = 8.0;
/// Rows of a road channel above the horizon: its filters reach over them.
constexpr int kAboveHorizon = 4;
/// The centre of a pixel of half size lies between two of full size.
const PixelMap kHalf{{2.0, 2.0}, {0.5, 0.5}};

/// The camera in the pixels of an image that is `map` away from the camera's own pixels.
Camera camera_in(const Camera& camera, const PixelMap& map, const cv::Size& size) {
  const Eigen::Vector2d centre = map.from_input({camera.cx_px, camera.cy_px});
  return {camera.fx_px / map.scale.x(),
          camera.fy_px / map.scale.y(),
          centre.x(),
          centre.y(),
          size.width,
          size.height};
}

/// Values and their gradient (central differences), pixel by pixel; `hidden`: of their size, or
/// empty.
cv::Mat with_gradient(const cv::Mat& values, const cv::Mat& hidden) {
  cv::Mat along_x;
  cv::Mat along_y;
  cv::Mat result;
  cv::Sobel(values, along_x, CV_32F, 1, 0, 1, 0.5, 0.0, cv::BORDER_REPLICATE);
  cv::Sobel(values, along_y, CV_32F, 0, 1, 1, 0.5, 0.0, cv::BORDER_REPLICATE);
  const cv::Mat shown = cv::Mat::zeros(values.size(), CV_32F);
  cv::merge(std::vector{values, along_x, along_y, hidden.empty() ? shown : hidden}, result);
  return result;
}

RoadImage::Level make_level(const cv::Mat& pixels,
                            const cv::Mat& mask,
                            const Camera& camera,
                            int contrast_px) {
  RoadImage::Level level;
  level.camera = camera;
  level.first_row = std::clamp(static_cast<int>(camera.cy_px), 0, pixels.rows);
  if (pixels.rows - level.first_row < 4 * contrast_px || pixels.cols < 4 * contrast_px) {
    return level;
  }
  cv::Mat values;
  pixels.rowRange(level.first_row, pixels.rows).convertTo(values, CV_32F);
  cv::GaussianBlur(values, values, {5, 5}, 1.0, 1.0, cv::BORDER_REFLECT_101);
  cv::Mat mean;
  const cv::Size window(2 * contrast_px + 1, 2 * contrast_px + 1);
  cv::blur(values, mean, window);
  values -= mean;
  cv::Mat contrast;
  cv::blur(values.mul(values), contrast, window);
  cv::sqrt(contrast, contrast);
  // Half a gray value: the noise of a plain surface is not blown up to the size of texture.
  values /= contrast + 0.5;
  cv::Mat hidden;
  if (!mask.empty()) {  // and what the local contrast mixes with it
    cv::Mat(mask.rowRange(level.first_row, mask.rows) == 0).convertTo(hidden, CV_32F, 1.0 / 255.0);
    cv::dilate(hidden, hidden, cv::Mat::ones(window, CV_8U));
  }
  level.values = with_gradient(values, hidden);
  return level;
}

int contrast_reach(const RoadImage& road) {
  return std::max(4, cvRound(kContrast_px / road.map.scale.x()));
}

}  // namespace

Channel road_channel(const cv::Mat& image, const Camera& camera) {
  const bool is_half = choose_tracking_resolution(TrackingResolution::kAuto, FeatureMethod::kPatch,
                                                  camera) == TrackingResolution::kHalf;
  const int step = is_half && std::min(image.cols, image.rows) > 1 ? 2 : 1;
  // Whole pixels of the result: an odd last row or column is left out.
  const int cols = image.cols / step;
  const int rows = image.rows / step;
  const int above =
      std::clamp(static_cast<int>(camera.cy_px) / step - kAboveHorizon, 0, std::max(0, rows - 1));
  cv::Mat values = image({0, step * above, step * cols, step * (rows - above)});
  if (image.channels() == 3) {
    cv::cvtColor(values, values, cv::COLOR_RGB2GRAY);
  }
  values.convertTo(values, CV_32F);
  cv::resize(values, values, {cols, rows - above}, 0.0, 0.0, cv::INTER_AREA);
  const cv::Matx41f along_x(1.0F, 1.0F, 1.0F, 1.0F);
  const cv::Matx41f along_y(-2.2F, -1.0F, 1.0F, 2.2F);
  cv::sepFilter2D(values, values, CV_32F, along_x, along_y);
  Channel channel{values, {}};
  channel.map.scale.setConstant(step);
  // Four pixels have their middle between two.
  channel.map.offset_px = {-0.5, step * above - 0.5};
  return channel;
}

bool shows_texture(const cv::Mat& image, const Camera& camera) {
  constexpr double kMinSpread = 2.0;  // gray levels; four of them, evenly used, have 1.1
  const int horizon = std::clamp(static_cast<int>(camera.cy_px), 0, image.rows - 1);
  cv::Scalar mean, spread;
  cv::meanStdDev(image.rowRange(horizon, image.rows), mean, spread);
  return *std::ranges::max_element(spread.val) > kMinSpread;
}

RoadImage make_road_image(const ChannelImage& image, const Camera& camera, const cv::Mat& mask) {
  RoadImage road{image.pixels, mask, image.map, {}};
  road.full.camera = camera_in(camera, image.map, image.pixels.size());
  if (std::min(image.pixels.rows, image.pixels.cols) >= 2) {
    road.full = make_level(image.pixels, mask, road.full.camera, contrast_reach(road));
  }
  return road;
}

RoadImage::Level make_half_level(const RoadImage& road) {
  cv::Mat half;
  cv::resize(road.pixels, half, {}, 0.5, 0.5, cv::INTER_AREA);
  cv::Mat mask;
  if (!road.mask.empty()) {
    cv::resize(road.mask, mask, half.size(), 0.0, 0.0, cv::INTER_NEAREST);
  }
  return make_level(half, mask, camera_in(road.full.camera, kHalf, half.size()),
                    contrast_reach(road));
}

RoadImage seen_by(const RoadImage& road, const Camera& camera) {
  RoadImage result = road;
  result.full.camera = camera_in(camera, road.map, road.pixels.size());
  return result;
}

}  // namespace stemvo
