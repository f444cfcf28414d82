// SPDX-License-Identifier: MIT
#include "features/klt_front_end.hpp"

#include <algorithm>

#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "features/grid_quota.hpp"

namespace stemvo {
namespace {

constexpr int kBackLevels = 2;

Eigen::Vector2d to_input(const PixelMap& map, const cv::Point2f& uv) {
  return map.to_input({static_cast<double>(uv.x), static_cast<double>(uv.y)});
}

/// Distance in input pixels between two points of one picture.
double input_distance_px(const PixelMap& map, const cv::Point2f& a, const cv::Point2f& b) {
  const Eigen::Vector2d difference(a.x - b.x, a.y - b.y);
  return map.scale.cwiseProduct(difference).norm();
}

bool is_inside(const cv::Point2f& uv, cv::Size size) {
  return uv.x >= 0.0F && uv.y >= 0.0F && uv.x <= static_cast<float>(size.width - 1) &&
         uv.y <= static_cast<float>(size.height - 1);
}

}  // namespace

Matches KltFrontEnd::process(const ChannelImage& image) {
  const std::vector<cv::Mat> pyramid = build_pyramid(image.pixels);
  Matches matches;
  if (picture_.size() == image.pixels.size()) {
    replenish(picture_);
    matches = track(image, pyramid);
  } else {
    points_.clear();
  }
  pyramid_ = pyramid;
  picture_ = image.pixels;
  map_ = image.map;
  return matches;
}

void KltFrontEnd::keep(const std::vector<char>& is_good) {
  if (is_good.size() != points_.size()) {
    return;
  }
  std::vector<Point> kept;
  kept.reserve(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (is_good[i] != 0) {
      kept.push_back(points_[i]);
    }
  }
  points_ = std::move(kept);
}

std::vector<cv::Mat> KltFrontEnd::build_pyramid(const cv::Mat& picture) const {
  std::vector<cv::Mat> pyramid;
  const cv::Size window(options_.klt_window, options_.klt_window);
  cv::buildOpticalFlowPyramid(picture, pyramid, window, options_.klt_levels - 1,
                              /*withDerivatives=*/true);
  return pyramid;
}

Matches KltFrontEnd::track(const ChannelImage& image, const std::vector<cv::Mat>& pyramid) {
  Matches matches;
  matches.num_keypoints = static_cast<int>(points_.size());
  if (points_.empty()) {
    return matches;
  }
  std::vector<cv::Point2f> prev_uv;
  prev_uv.reserve(points_.size());
  for (const Point& point : points_) {
    prev_uv.push_back(point.uv);
  }
  const cv::Size window(options_.klt_window, options_.klt_window);
  const cv::TermCriteria criteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 30, 0.01);
  std::vector<cv::Point2f> cur_uv;
  std::vector<cv::Point2f> back_uv = prev_uv;
  std::vector<unsigned char> found;
  std::vector<unsigned char> found_back;
  cv::calcOpticalFlowPyrLK(pyramid_, pyramid, prev_uv, cur_uv, found, cv::noArray(), window,
                           options_.klt_levels - 1, criteria);
  // The way back starts where the way there started: two levels are enough to leave a wrong place.
  const int back_levels = std::min(options_.klt_levels, kBackLevels);
  cv::calcOpticalFlowPyrLK(pyramid, pyramid_, cur_uv, back_uv, found_back, cv::noArray(), window,
                           back_levels - 1, criteria, cv::OPTFLOW_USE_INITIAL_FLOW);

  std::vector<Point> followed;
  followed.reserve(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const bool is_good =
        found[i] != 0 && found_back[i] != 0 && is_inside(cur_uv[i], image.pixels.size()) &&
        input_distance_px(map_, prev_uv[i], back_uv[i]) <= options_.max_forward_backward_px;
    if (!is_good) {
      continue;
    }
    followed.push_back({cur_uv[i], points_[i].id});
    matches.prev_uv.push_back(to_input(map_, prev_uv[i]));
    matches.cur_uv.push_back(to_input(image.map, cur_uv[i]));
    matches.track_ids.push_back(points_[i].id);
  }
  points_ = std::move(followed);
  return matches;
}

void KltFrontEnd::replenish(const cv::Mat& picture) {
  const double min_distance = options_.min_distance_px / map_.scale.minCoeff();
  GridQuota quota(options_, picture.size());
  cv::Mat mask(picture.size(), CV_8U, cv::Scalar(255));
  std::vector<Point> kept;
  kept.reserve(points_.size());
  for (const Point& point : points_) {
    const cv::Point center(cvRound(point.uv.x), cvRound(point.uv.y));
    if (mask.at<unsigned char>(center) == 0) {
      continue;  // tracks that ran into each other: the older one stays
    }
    cv::circle(mask, center, std::max(1, cvRound(min_distance)), cv::Scalar(0), cv::FILLED);
    quota.take(point.uv);
    kept.push_back(point);
  }
  points_ = std::move(kept);

  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(picture, corners, /*maxCorners=*/0, options_.corner_quality, min_distance,
                          mask, /*blockSize=*/3);
  for (const cv::Point2f& corner : corners) {  // strongest first
    if (quota.take(corner)) {
      points_.push_back({corner, next_id_++});
    }
  }
}

}  // namespace stemvo
