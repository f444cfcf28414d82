// SPDX-License-Identifier: MIT
#include "features/patch_front_end.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <limits>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// Minimum correlation of a patch with the image; below it the track is lost.
constexpr float kMinCorrelation = 0.7F;
/// Below this, or beyond this scale, the patch is cut out anew.
constexpr float kGoodCorrelation = 0.85F;
constexpr float kMaxScale = 1.4F;
/// A track that ended is where the map has it, within so many pixels, or nowhere.
constexpr float kMaxOff_px = 2.0F;
constexpr float kMinAgain = 0.8F;  ///< its correlation there
/// A point whose own motion is not known starts with the median of so many neighbours.
constexpr std::size_t kNumNeighbours = 5;
/// Where a motion is known, the level of half the size is coarse enough to begin.
constexpr int kPredictedLevel = 1;
/// Where fewer of the points are found, they have moved further than the levels asked for reach:
/// those that are missing are looked for from one coarser level on.
constexpr double kFewFound = 0.3;

/// Motions of points between two images.
class Motions {
 public:
  explicit Motions(std::size_t max_size) { known_.reserve(max_size); }
  [[nodiscard]] bool empty() const { return known_.empty(); }
  void add(const cv::Point2f& from, const cv::Point2f& motion) { known_.push_back({from, motion}); }
  /// Median of the nearest; none: 0.
  [[nodiscard]] cv::Point2f near(const cv::Point2f& uv) const;

 private:
  struct Known {
    cv::Point2f from;
    cv::Point2f motion;
  };
  std::vector<Known> known_;
};

cv::Point2f Motions::near(const cv::Point2f& uv) const {
  struct Near {
    float distance_sq = std::numeric_limits<float>::infinity();
    cv::Point2f motion;
  };
  std::array<Near, kNumNeighbours> nearest;  // the nearest first
  for (const Known& known : known_) {
    const cv::Point2f to = known.from - uv;
    const float distance_sq = to.dot(to);
    if (distance_sq < nearest.back().distance_sq) {
      std::size_t i = kNumNeighbours - 1;
      for (; i > 0 && distance_sq < nearest[i - 1].distance_sq; --i) {
        nearest[i] = nearest[i - 1];
      }
      nearest[i] = {distance_sq, known.motion};
    }
  }
  const std::size_t count = std::min(kNumNeighbours, known_.size());
  if (count == 0) {
    return {};
  }
  const auto median = [&](float cv::Point2f::* axis) {
    const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(nearest.begin(), middle, nearest.begin() + static_cast<std::ptrdiff_t>(count),
                     [&](const Near& a, const Near& b) { return a.motion.*axis < b.motion.*axis; });
    return middle->motion.*axis;
  };
  return {median(&cv::Point2f::x), median(&cv::Point2f::y)};
}

}  // namespace

struct PatchFrontEnd::PatchPyramid : ImagePyramid {
  using ImagePyramid::ImagePyramid;
  std::vector<BorderedImage> bordered;  ///< the levels, each in the middle of a larger image
};

std::shared_ptr<const ImagePyramid> PatchFrontEnd::prepare(const ChannelImage& channel) const {
  const StageTimer timer(Stage::kPyramid);
  auto image = std::make_shared<PatchPyramid>(channel);
  image->levels.clear();
  cv::Mat level = channel.pixels;
  const int num = num_levels(channel.map.scale.minCoeff()) + 1;  // the last for large motions
  for (int i = 0; i < num; ++i) {
    if (i > 0) {
      cv::Mat half;
      cv::pyrDown(level, half);
      level = half;
    }
    constexpr int kBorder = kPatchBorder_px;
    cv::Mat bordered;
    cv::copyMakeBorder(level, bordered, kBorder, kBorder, kBorder, kBorder, cv::BORDER_REFLECT_101);
    level = bordered(cv::Rect(kBorder, kBorder, level.cols, level.rows));
    image->levels.push_back(level);
    image->bordered.push_back(
        {level.data, static_cast<std::ptrdiff_t>(level.step), level.cols, level.rows});
  }
  return image;
}

bool PatchFrontEnd::begin_track(const ImagePyramid& image, const Point& point) {
  Track track;
  track.warp = {point.uv.x, point.uv.y};
  const Pyramid pyramid = static_cast<const PatchPyramid&>(image).bordered;
  if (!cut_patch(pyramid, point.uv.x, point.uv.y, track.patch)) {
    return false;
  }
  if (ended_.empty()) {
    return tracks_.emplace(point.id, track).second;
  }
  auto node = std::move(ended_.back());
  ended_.pop_back();
  node.key() = point.id;
  node.mapped() = track;
  return tracks_.insert(std::move(node)).inserted;
}

std::vector<std::optional<cv::Point2f>> PatchFrontEnd::track_points(const View& from,
                                                                    const View& to) {
  const auto& image = static_cast<const PatchPyramid&>(*to.image);
  const Pyramid pyramid = image.bordered;
  const int coarsest = static_cast<int>(pyramid.size()) - 1;
  const int top = coarsest - 1;
  const int predicted = std::min(kPredictedLevel, top);
  Motions motions(from.points.size());
  const auto align = [&](const Point& point, const cv::Point2f& motion, int first_level) {
    const Track& track = tracks_.at(point.id);
    const cv::Point2f start = point.uv + motion;
    return align_patch(track.patch, pyramid, {start.x, start.y, track.warp.a, track.warp.b},
                       first_level);
  };
  // First the points that were tracked to here: they tell the others where to look.
  std::vector<PatchMatch> found(from.points.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Point& point = from.points[i];
    const Track& track = tracks_.at(point.id);
    if (track.frame == from.frame) {
      found[i] = align(point, track.motion, predicted);
      if (found[i].correlation >= kMinCorrelation) {
        motions.add(point.uv, cv::Point2f(found[i].warp.x, found[i].warp.y) - point.uv);
      }
    }
  }
  std::vector<std::optional<cv::Point2f>> result(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Point& point = from.points[i];
    const Track& track = tracks_.at(point.id);
    if (found[i].correlation < kMinCorrelation) {
      const cv::Point2f motion = motions.near(point.uv);
      const bool is_predicted = track.frame != from.frame && !motions.empty();
      found[i] = align(point, motion, is_predicted ? predicted : top);
      if (found[i].correlation < kMinCorrelation && is_predicted) {
        found[i] = align(point, motion, top);
      }
    }
  }
  const auto is_found = [](const PatchMatch& one) { return one.correlation >= kMinCorrelation; };
  const auto num_found = static_cast<double>(std::ranges::count_if(found, is_found));
  const bool is_far =
      top < Patch::kNumCoarse && num_found < kFewFound * static_cast<double>(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Point& point = from.points[i];
    Track& track = tracks_.at(point.id);
    if (is_far && !is_found(found[i])) {
      found[i] = align(point, motions.near(point.uv), coarsest);
      if (is_found(found[i])) {
        motions.add(point.uv, cv::Point2f(found[i].warp.x, found[i].warp.y) - point.uv);
      }
    }
    if (accept(found[i], image, to.frame, point, track)) {
      result[i] = cv::Point2f(track.warp.x, track.warp.y);
    }
  }
  return result;
}

bool PatchFrontEnd::accept(const PatchMatch& found,
                           const PatchPyramid& image,
                           int frame,
                           const Point& from,
                           Track& track) {
  if (found.correlation < kMinCorrelation) {
    return false;
  }
  track.warp = found.warp;
  track.motion = cv::Point2f(found.warp.x, found.warp.y) - from.uv;
  track.frame = frame;
  const float scale_sq = found.warp.a * found.warp.a + found.warp.b * found.warp.b;
  constexpr float kMaxSq = kMaxScale * kMaxScale;
  if (found.correlation >= kGoodCorrelation && scale_sq < kMaxSq && scale_sq * kMaxSq > 1.0F) {
    return true;
  }
  track.warp = {found.warp.x, found.warp.y};
  return cut_patch(image.bordered, found.warp.x, found.warp.y, track.patch);
}

std::optional<cv::Point2f> PatchFrontEnd::match_projection(const ImagePyramid& image,
                                                           const Point& point) {
  const auto known = tracks_.find(point.id);
  if (known == tracks_.end()) {
    return std::nullopt;
  }
  Track& track = known->second;
  const PatchMatch found =
      align_patch(track.patch, static_cast<const PatchPyramid&>(image).bordered,
                  {point.uv.x, point.uv.y, track.warp.a, track.warp.b}, kPredictedLevel);
  const cv::Point2f uv(found.warp.x, found.warp.y);
  const cv::Point2f off = uv - point.uv;
  if (found.correlation < kMinAgain || off.dot(off) > kMaxOff_px * kMaxOff_px) {
    ended_.push_back(tracks_.extract(known));
    return std::nullopt;
  }
  track.warp = found.warp;
  return uv;
}

void PatchFrontEnd::end_other_tracks(const std::vector<Point>& last,
                                     const std::vector<Point>& good,
                                     const Observations& expected) {
  const auto has = [](const auto& points, auto id_of, int id) {
    const auto found = std::ranges::lower_bound(points, id, {}, id_of);
    return found != points.end() && std::invoke(id_of, *found) == id;
  };
  for (auto track = tracks_.begin(); track != tracks_.end();) {
    const int id = track->first;
    const bool goes_on = has(last, &Point::id, id) || has(good, &Point::id, id) ||
                         has(expected, &Observation::track_id, id);
    const auto current = track++;
    if (!goes_on) {
      ended_.push_back(tracks_.extract(current));
    }
  }
}

}  // namespace stemvo
