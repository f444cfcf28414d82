// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "features/patch_alignment.hpp"
#include "features/patch_pyramid.hpp"
#include "features/point_front_end.hpp"
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
/// So many points say whether a hint of the turn leads to them.
constexpr std::size_t kNumProbes = 40;
/// A hint that moves a start by less says what is expected anyway.
constexpr float kSameStart_px = 1.0F;

bool is_found(const PatchMatch& match) { return match.correlation >= kMinCorrelation; }

/// Motions of points between two images.
class Motions {
 public:
  explicit Motions(std::size_t max_size) { known_.reserve(max_size); }
  [[nodiscard]] bool empty() const { return known_.empty(); }
  void add(const cv::Point2f& from, const cv::Point2f& motion) { known_.push_back({from, motion}); }
  /// Median of the nearest; none: 0.
  [[nodiscard]] cv::Point2f near(const cv::Point2f& uv) const {
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
      std::nth_element(
          nearest.begin(), middle, nearest.begin() + static_cast<std::ptrdiff_t>(count),
          [&](const Near& a, const Near& b) { return a.motion.*axis < b.motion.*axis; });
      return middle->motion.*axis;
    };
    return {median(&cv::Point2f::x), median(&cv::Point2f::y)};
  }

 private:
  struct Known {
    cv::Point2f from;
    cv::Point2f motion;
  };
  std::vector<Known> known_;
};

/// How far a turn, as ImageClue::turn, moves a pixel that shows what is far away.
cv::Point2f shift_of(const Eigen::Matrix3d& turn, const PixelMap& map, const cv::Point2f& uv) {
  constexpr double kMinDepth = 0.2;  // beyond 78 degrees of turn: out of view
  const Eigen::Vector3d to = turn * map.to_input({uv.x, uv.y}).homogeneous();
  if (!(to.z() > kMinDepth)) {
    return {};
  }
  const Eigen::Vector2d there = map.from_input(to.hnormalized());
  return cv::Point2f(static_cast<float>(there.x()), static_cast<float>(there.y())) - uv;
}

/// Tracks by aligning the patch cut out when a point was new. A patch that has changed too much is
/// cut out anew where the point is; the track keeps its id.
class PatchFrontEnd final : public PointFrontEnd {
 public:
  using PointFrontEnd::PointFrontEnd;

  [[nodiscard]] std::shared_ptr<ImagePyramid> prepare(const ChannelImage& channel,
                                                      const cv::Mat& mask) const override {
    const StageTimer timer(Stage::kPyramid);
    // The last level is for large motions.
    auto image =
        std::make_shared<PatchPyramid>(channel, num_levels(channel.map.scale.minCoeff()) + 1);
    image->mask = with_mask(mask);
    return image;
  }

 private:
  /// The motions that are expected of points between two images.
  class Outlook {
   public:
    Outlook(const View& from, const View& to)
        : from_(from),
          ratio_(from.interval_s > 0.0
                     ? static_cast<float>((to.time_s - from.time_s) / from.interval_s)
                     : 1.0F) {}

    /// The motion of a point that came by `motion`, at the same speed.
    [[nodiscard]] cv::Point2f on(const cv::Point2f& motion) const { return ratio_ * motion; }
    [[nodiscard]] bool knows_turn() const { return from_.turn_to_newest.has_value(); }
    /// By the turn alone.
    [[nodiscard]] cv::Point2f turned(const cv::Point2f& uv) const {
      return shift_of(*from_.turn_to_newest, from_.image->channel.map, uv);
    }
    /// By the turn, and at the same speed what an earlier turn leaves of `motion`.
    [[nodiscard]] cv::Point2f turned(const cv::Point2f& uv, const cv::Point2f& motion) const {
      const PixelMap& map = from_.image->channel.map;
      return turned(uv) + (from_.turn.has_value()
                               ? on(motion - shift_of(*from_.turn, map, uv - motion))
                               : cv::Point2f());
    }

   private:
    const View& from_;
    float ratio_;  ///< of the interval to the one before
  };

  struct Track {
    Patch patch;
    Similarity warp;     ///< from the patch to the last image it was found in
    cv::Point2f motion;  ///< to there, from the image before
    int frame = -1;      ///< the number of that image; -1: it is new
  };

  [[nodiscard]] bool begin_track(const ImagePyramid& image, const Point& point) override {
    Track track;
    track.warp = {point.uv.x, point.uv.y};
    const Pyramid pyramid = static_cast<const PatchPyramid&>(image).bordered;
    if (!cut_patch(pyramid, point.uv.x, point.uv.y, track.patch)) {
      return false;
    }
    return tracks_.emplace(point.id, track).second;
  }

  [[nodiscard]] std::vector<std::optional<cv::Point2f>> track_points(const View& from,
                                                                     View& to) override {
    const auto& image = static_cast<const PatchPyramid&>(*to.image);
    const Pyramid pyramid = image.bordered;
    const int coarsest = static_cast<int>(pyramid.size()) - 1;
    const int top = coarsest - 1;
    const int predicted = std::min(kPredictedLevel, top);
    Motions motions(from.points.size());
    std::vector<Track*> tracks;  // of the points
    for (const Point& point : from.points) {
      tracks.push_back(&tracks_.at(point.id));
    }
    const auto align = [&](std::size_t i, const cv::Point2f& motion, int first_level) {
      const Point& point = from.points[i];
      const Track& track = *tracks[i];
      const cv::Point2f start = point.uv + motion;
      return align_patch(track.patch, pyramid, {start.x, start.y, track.warp.a, track.warp.b},
                         first_level);
    };
    const Outlook outlook(from, to);
    const bool is_turned =
        outlook.knows_turn() && leads_to_points(outlook, from, tracks, align, top);
    if (is_turned) {
      to.turn = from.turn_to_newest;
    }
    const auto near = [&](const cv::Point2f& uv) {
      return motions.empty() && is_turned ? outlook.turned(uv) : motions.near(uv);
    };
    std::vector<PatchMatch> found(from.points.size());
    const auto add_motion = [&](std::size_t i) {
      if (is_found(found[i])) {
        const cv::Point2f& uv = from.points[i].uv;
        motions.add(uv, cv::Point2f(found[i].warp.x, found[i].warp.y) - uv);
      }
    };
    // First the points that were tracked to here: they tell the others where to look.
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (tracks[i]->frame == from.frame) {
        const cv::Point2f& motion = tracks[i]->motion;
        found[i] =
            align(i, is_turned ? outlook.turned(from.points[i].uv, motion) : outlook.on(motion),
                  predicted);
        add_motion(i);
      }
    }
    std::vector<std::optional<cv::Point2f>> result(found.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (!is_found(found[i])) {
        const cv::Point2f motion = near(from.points[i].uv);
        const bool is_predicted = tracks[i]->frame != from.frame && !motions.empty();
        found[i] = align(i, motion, is_predicted ? predicted : top);
        if (!is_found(found[i]) && is_predicted) {
          found[i] = align(i, motion, top);
        }
      }
    }
    const auto num_found = static_cast<double>(std::ranges::count_if(found, is_found));
    const bool is_far =
        top < Patch::kNumCoarse && num_found < kFewFound * static_cast<double>(found.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      const Point& point = from.points[i];
      Track& track = *tracks[i];
      if (is_far && !is_found(found[i])) {
        found[i] = align(i, near(point.uv), coarsest);
        add_motion(i);
      }
      if (accept(found[i], image, to.frame, point, track)) {
        result[i] = cv::Point2f(track.warp.x, track.warp.y);
      }
    }
    return result;
  }

  /// A hint may be wrong: it counts where it leads to points, and to as many as no hint does.
  /// Patches are found in wrong places, too, now and then: few points say nothing.
  template <typename Align>
  [[nodiscard]] bool leads_to_points(const Outlook& outlook,
                                     const View& from,
                                     const std::vector<Track*>& tracks,
                                     const Align& align,
                                     int top) const {
    int num_probes = 0;
    int num_with = 0;
    int num_without = 0;
    const std::size_t step = std::max<std::size_t>(1, from.points.size() / kNumProbes);
    for (std::size_t i = 0; i < from.points.size(); i += step) {
      const Point& point = from.points[i];
      const Track& track = *tracks[i];
      const bool knows_motion = track.frame == from.frame;
      const int level = knows_motion ? std::min(kPredictedLevel, top) : top;
      const cv::Point2f with =
          knows_motion ? outlook.turned(point.uv, track.motion) : outlook.turned(point.uv);
      const cv::Point2f without = knows_motion ? outlook.on(track.motion) : cv::Point2f();
      if (const cv::Point2f off = with - without; off.dot(off) > kSameStart_px * kSameStart_px) {
        ++num_probes;
        num_with += align(i, with, level).correlation >= kMinCorrelation ? 1 : 0;
        num_without += align(i, without, level).correlation >= kMinCorrelation ? 1 : 0;
      }
    }
    return num_with >= std::max<double>(num_without, kFewFound * num_probes);
  }

  [[nodiscard]] std::optional<cv::Point2f> match_projection(const ImagePyramid& image,
                                                            const Point& point,
                                                            bool may_be_hidden) override {
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
      if (!may_be_hidden) {
        tracks_.erase(known);
      }
      return std::nullopt;
    }
    track.warp = found.warp;
    return uv;
  }

  void end_other_tracks(const std::vector<Point>& last,
                        const std::vector<Point>& good,
                        const Observations& expected) override {
    const auto has = [](const auto& points, auto id_of, int id) {
      const auto found = std::ranges::lower_bound(points, id, {}, id_of);
      return found != points.end() && std::invoke(id_of, *found) == id;
    };
    std::erase_if(tracks_, [&](const auto& track) {
      const int id = track.first;
      return !has(last, &Point::id, id) && !has(good, &Point::id, id) &&
             !has(expected, &Observation::track_id, id);
    });
  }

  [[nodiscard]] static bool accept(const PatchMatch& found,
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

  std::map<int, Track> tracks_;  ///< by id
};

}  // namespace

std::unique_ptr<FrontEnd> create_patch_front_end(const FeatureOptions& options) {
  return std::make_unique<PatchFrontEnd>(options);
}

}  // namespace stemvo
