// SPDX-License-Identifier: MIT
#include "features/klt_front_end.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "features/grid_quota.hpp"
#include "internal_check.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

constexpr int kBackLevels = 2;
constexpr int kMaxIterations = 15;       ///< per level
constexpr double kConverged_px = 0.015;  ///< an iteration's step, picture pixels
/// Windows of 5x5 pixels lose the road: t_rel 0.85 for 0.31 on a rendered drive, whatever their
/// size in the input.
constexpr int kMinReach_px = 3;
/// A smaller share of the points tracked: the image is of no use, or of another place.
constexpr double kMinTracked = 0.1;
/// In a pyramid each level is followed by its derivatives.
constexpr std::size_t kNextLevel = 2;

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

struct KltFrontEnd::Picture : PreparedPicture {
  using PreparedPicture::PreparedPicture;
  [[nodiscard]] int last_level() const { return static_cast<int>(pyramid.size() / kNextLevel) - 1; }
  std::vector<cv::Mat> pyramid;
  cv::Size window;
};

std::shared_ptr<const PreparedPicture> KltFrontEnd::prepare(const ChannelImage& image) const {
  const StageTimer timer(Stage::kPyramid);
  auto picture = std::make_shared<Picture>(image);
  const double scale = image.map.scale.minCoeff();
  const int reach = std::max(kMinReach_px, static_cast<int>(options_.klt_window / 2 / scale));
  picture->window = cv::Size(2 * reach + 1, 2 * reach + 1);
  // A picture of half the input's size is its pyramid's second level.
  const int last_level = std::max(0, options_.klt_levels - 1 - std::ilogb(scale));
  cv::buildOpticalFlowPyramid(image.pixels, picture->pyramid, picture->window, last_level,
                              /*withDerivatives=*/true);
  return picture;
}

Matches KltFrontEnd::process(std::shared_ptr<const PreparedPicture> prepared, int frame) {
  auto picture = std::dynamic_pointer_cast<const Picture>(std::move(prepared));
  STEMVO_CHECK(picture != nullptr, "a picture prepared by this front end");
  if (last_.picture != nullptr &&
      last_.picture->image.pixels.size() != picture->image.pixels.size()) {
    last_ = {};
    last_good_ = {};
  }
  Matches matches;
  View now{std::move(picture), {}, frame};
  if (last_.picture != nullptr) {
    replenish(last_);
    matches = track(last_, now);
    if (is_lost(matches, last_)) {
      track_from_last_good(now, matches);
    } else {
      last_good_ = {};
    }
  }
  last_ = std::move(now);
  return matches;
}

/// Nearly every track ended: darkness, a blow, or another place. Where the image before the trouble
/// tells more than the last one, its tracks go on.
void KltFrontEnd::track_from_last_good(View& now, Matches& matches) {
  if (last_good_.picture == nullptr && !last_.points.empty()) {
    last_good_ = std::move(last_);
    return;
  }
  if (last_good_.picture == nullptr) {
    return;
  }
  View again{now.picture, {}, now.frame};
  Matches found = track(last_good_, again);
  if (!is_lost(found, last_good_)) {
    now = std::move(again);
    matches = std::move(found);
    last_good_ = {};
  }
}

bool KltFrontEnd::is_lost(const Matches& matches, const View& from) {
  return static_cast<double>(matches.cur_uv.size()) <=
         kMinTracked * static_cast<double>(from.points.size());
}

void KltFrontEnd::keep(const std::vector<char>& is_good) {
  if (is_good.size() != last_.points.size()) {
    return;
  }
  std::vector<Point> kept;
  kept.reserve(is_good.size());
  for (std::size_t i = 0; i < is_good.size(); ++i) {
    if (is_good[i] != 0) {
      kept.push_back(last_.points[i]);
    }
  }
  last_.points = std::move(kept);
}

Matches KltFrontEnd::track(const View& from, View& to) const {
  const StageTimer timer(Stage::kTracking);
  const Picture& prev = *from.picture;
  const Picture& cur = *to.picture;
  Matches matches;
  matches.prev_frame = from.frame;
  matches.num_keypoints = static_cast<int>(from.points.size());
  if (from.points.empty()) {
    return matches;
  }
  std::vector<cv::Point2f> prev_uv;
  prev_uv.reserve(from.points.size());
  for (const Point& point : from.points) {
    prev_uv.push_back(point.uv);
  }
  const cv::TermCriteria criteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, kMaxIterations,
                                  kConverged_px);
  std::vector<cv::Point2f> cur_uv;
  std::vector<cv::Point2f> back_uv = prev_uv;
  std::vector<unsigned char> found;
  std::vector<unsigned char> found_back;
  cv::calcOpticalFlowPyrLK(prev.pyramid, cur.pyramid, prev_uv, cur_uv, found, cv::noArray(),
                           cur.window, cur.last_level(), criteria);
  // The way back starts where the way there started: two levels are enough to leave a wrong place.
  cv::calcOpticalFlowPyrLK(cur.pyramid, prev.pyramid, cur_uv, back_uv, found_back, cv::noArray(),
                           cur.window, std::min(cur.last_level(), kBackLevels - 1), criteria,
                           cv::OPTFLOW_USE_INITIAL_FLOW);

  to.points.reserve(from.points.size());
  for (std::size_t i = 0; i < from.points.size(); ++i) {
    const bool is_good = found[i] != 0 && found_back[i] != 0 &&
                         is_inside(cur_uv[i], cur.image.pixels.size()) &&
                         input_distance_px(prev.image.map, prev_uv[i], back_uv[i]) <=
                             options_.max_forward_backward_px;
    if (!is_good) {
      continue;
    }
    to.points.push_back({cur_uv[i], from.points[i].id});
    matches.prev_uv.push_back(to_input(prev.image.map, prev_uv[i]));
    matches.cur_uv.push_back(to_input(cur.image.map, cur_uv[i]));
    matches.track_ids.push_back(from.points[i].id);
  }
  return matches;
}

/// Corners are looked for one level up, at half the size: the window that follows them is several
/// pixels wide, and any pixel of a corner will do.
void KltFrontEnd::replenish(View& view) {
  const StageTimer timer(Stage::kDetection);
  const Picture& picture = *view.picture;
  const bool is_halved = picture.last_level() > 0;
  const cv::Mat& pixels = picture.pyramid[is_halved ? kNextLevel : 0];
  const float to_pixels = is_halved ? 2.0F : 1.0F;
  const double min_distance =
      options_.min_distance_px / (picture.image.map.scale.minCoeff() * to_pixels);
  GridQuota quota(options_, picture.image.pixels.size());
  cv::Mat mask(pixels.size(), CV_8U, cv::Scalar(255));
  std::vector<Point> kept;
  kept.reserve(view.points.size());
  for (const Point& point : view.points) {
    const cv::Point center(std::min(cvRound(point.uv.x / to_pixels), mask.cols - 1),
                           std::min(cvRound(point.uv.y / to_pixels), mask.rows - 1));
    if (mask.at<unsigned char>(center) == 0) {
      continue;  // tracks that ran into each other: the older one stays
    }
    cv::circle(mask, center, std::max(1, cvRound(min_distance)), cv::Scalar(0), cv::FILLED);
    quota.take(point.uv);
    kept.push_back(point);
  }
  view.points = std::move(kept);

  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(pixels, corners, /*maxCorners=*/0, options_.corner_quality, min_distance,
                          mask, /*blockSize=*/3);
  for (const cv::Point2f& corner : corners) {  // strongest first
    if (quota.take(corner * to_pixels)) {
      view.points.push_back({corner * to_pixels, next_id_++});
    }
  }
}

}  // namespace stemvo
