// SPDX-License-Identifier: MIT
#include "features/point_front_end.hpp"

#include <cstddef>

#include <opencv2/imgproc.hpp>

#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// A smaller share of the points tracked: the image is of no use, or of another place.
constexpr double kMinTracked = 0.1;

cv::Point pixel_of(const cv::Mat& image, const cv::Point2f& uv) {
  return {std::clamp(cvRound(uv.x), 0, image.cols - 1),
          std::clamp(cvRound(uv.y), 0, image.rows - 1)};
}

/// Corners are looked for at half the size where that is at hand: the patch that is tracked is
/// several pixels wide, and any pixel of a corner will do.
std::size_t detection_level(const ImagePyramid& image) { return image.levels.size() > 1 ? 1 : 0; }

/// cv::circle's, drawn once: it takes as long as the corners to draw one around each point.
class Disc {
 public:
  explicit Disc(int radius) : pixels_(2 * radius + 1, 2 * radius + 1, uchar{0}) {
    cv::circle(pixels_, {radius, radius}, radius, cv::Scalar(255), cv::FILLED);
  }

  void clear(cv::Mat& mask, const cv::Point& center) const {
    const cv::Point corner = center - cv::Point(pixels_.cols / 2, pixels_.rows / 2);
    const cv::Rect inside = cv::Rect(corner, pixels_.size()) & cv::Rect({}, mask.size());
    mask(inside).setTo(cv::Scalar(0), pixels_(inside - corner));
  }

 private:
  cv::Mat1b pixels_;
};

}  // namespace

Matches PointFrontEnd::process(std::shared_ptr<const ImagePyramid> image, const ImageClue& clue) {
  if (last_.image != nullptr &&
      last_.image->channel.pixels.size() != image->channel.pixels.size()) {
    last_ = {};
    last_good_ = {};
    projections_.clear();
  }
  for (std::optional<Eigen::Matrix3d>* turn : {&last_.turn_to_newest, &last_good_.turn_to_newest}) {
    const bool is_known = clue.turn.has_value() && turn->has_value();
    *turn = is_known ? std::optional<Eigen::Matrix3d>(*clue.turn * **turn) : std::nullopt;
  }
  Matches matches;
  View now{std::move(image), {}, clue.frame, clue.time_s};
  end_other_tracks(last_.points, last_good_.points, projections_);
  if (last_.image != nullptr) {
    replenish(last_);
    matches = track(last_, now);
    if (is_lost(matches, last_good_.image != nullptr ? last_good_ : last_)) {
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
void PointFrontEnd::track_from_last_good(View& now, Matches& matches) {
  if (last_good_.image == nullptr) {
    last_good_ = last_.points.empty() ? View() : std::move(last_);
    return;
  }
  View again{now.image, {}, now.frame, now.time_s};
  Matches found = track(last_good_, again);
  if (!is_lost(found, last_good_)) {
    now = std::move(again);
    matches = std::move(found);
    last_good_ = {};
  }
}

bool PointFrontEnd::is_lost(const Matches& matches, const View& from) {
  return static_cast<double>(matches.cur_uv.size()) <=
         kMinTracked * static_cast<double>(from.points.size());
}

void PointFrontEnd::remove_outliers(const std::vector<char>& is_inlier) {
  if (is_inlier.size() == last_.points.size()) {
    auto flag = is_inlier.begin();
    std::erase_if(last_.points, [&](const Point&) { return *flag++ == 0; });
  }
}

Matches PointFrontEnd::track(const View& from, View& to) {
  Matches matches;
  matches.prev_frame = from.frame;
  const std::vector<std::optional<cv::Point2f>> found =
      timed(Stage::kTracking, [&] { return track_points(from, to); });
  to.interval_s = to.time_s - from.time_s;
  const cv::Mat mask = to.image->mask_of(to.image->channel.map, to.image->channel.pixels.size());
  to.points.reserve(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!found[i].has_value() ||
        (!mask.empty() && mask.at<unsigned char>(pixel_of(mask, *found[i])) == 0)) {
      continue;
    }
    const Point& point = from.points[i];
    to.points.push_back({*found[i], point.id});
    matches.prev_uv.push_back(from.image->channel.map.to_input({point.uv.x, point.uv.y}));
    matches.cur_uv.push_back(to.image->channel.map.to_input({found[i]->x, found[i]->y}));
    matches.track_ids.push_back(point.id);
  }
  return matches;
}

/// Appends the points that are found.
void PointFrontEnd::match_projections(View& view) {
  const cv::Rect2f inside({}, cv::Size2f(view.image->channel.pixels.size()));
  const std::vector<Point> tracked = view.points;
  for (const Observation& expected : std::exchange(projections_, {})) {
    if (std::ranges::binary_search(tracked, expected.track_id, {}, &Point::id) ||
        std::ranges::binary_search(last_good_.points, expected.track_id, {}, &Point::id)) {
      continue;  // tracked here, or from the last good image
    }
    const Eigen::Vector2d uv = view.image->channel.map.from_input(expected.uv);
    const cv::Point2f start(static_cast<float>(uv.x()), static_cast<float>(uv.y()));
    if (!inside.contains(start)) {
      continue;
    }
    if (const auto found =
            match_projection(*view.image, {start, expected.track_id}, may_be_hidden_)) {
      view.points.push_back({*found, expected.track_id});
    }
  }
}

std::vector<cv::Point2f> PointFrontEnd::corners(const ImagePyramid& image,
                                                const cv::Mat& mask,
                                                const FeatureOptions& options) {
  const std::size_t level = detection_level(image);
  const auto to_pixels = static_cast<float>(1 << level);
  const double min_distance =
      options.min_distance_px / (image.channel.map.scale.minCoeff() * to_pixels);
  std::vector<cv::Point2f> found;
  cv::goodFeaturesToTrack(image.levels[level], found, /*maxCorners=*/0, options.corner_quality,
                          min_distance, mask, /*blockSize=*/3);
  for (cv::Point2f& corner : found) {
    corner *= to_pixels;
  }
  return found;
}

void PointFrontEnd::replenish(View& view) {
  const StageTimer timer(Stage::kDetection);
  match_projections(view);
  const ImagePyramid& image = *view.image;
  const std::size_t level = detection_level(image);
  const cv::Size size = image.levels[level].size();
  const auto to_pixels = static_cast<float>(1 << level);
  const double min_distance =
      options_.min_distance_px / (image.channel.map.scale.minCoeff() * to_pixels);
  GridQuota quota(options_, image.channel.pixels.size());
  PixelMap map = image.channel.map;
  map.scale *= to_pixels;
  cv::Mat mask = image.mask_of(map, size);
  if (mask.empty()) {
    mask = cv::Mat(size, CV_8U, cv::Scalar(255));
  }
  const Disc disc(std::max(1, cvRound(min_distance)));
  std::vector<Point> kept;
  kept.reserve(view.points.size());
  for (const Point& point : view.points) {
    const cv::Point center = pixel_of(mask, point.uv / to_pixels);
    if (mask.at<unsigned char>(center) == 0) {
      continue;  // collides with another point, the older one is kept; or is behind the mask
    }
    disc.clear(mask, center);
    quota.take(point.uv);
    kept.push_back(point);
  }
  std::ranges::sort(kept, {}, &Point::id);
  view.points = std::move(kept);
  for (const cv::Point2f& corner : corners(image, mask, options_)) {  // strongest first
    const Point point{corner, next_id_};
    if (quota.take(point.uv) && begin_track(image, point)) {
      view.points.push_back(point);
      ++next_id_;
    }
  }
}

}  // namespace stemvo
