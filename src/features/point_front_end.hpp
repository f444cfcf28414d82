// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "features/front_end.hpp"

namespace stemvo {

/// Corners tracked from image to image; cells that lost points are refilled with new corners. How
/// they are tracked is the derived class's.
class PointFrontEnd : public FrontEnd {
 public:
  explicit PointFrontEnd(const FeatureOptions& options) : options_(options) {}

  [[nodiscard]] Matches process(std::shared_ptr<const ImagePyramid> image,
                                const ImageClue& clue) override;
  void remove_outliers(const std::vector<char>& is_inlier) override;
  void expect_projections(Observations projections, bool may_hide) override {
    projections_ = std::move(projections);
    may_be_hidden_ = may_hide;
  }
  /// Where new points may begin: pixels of the image, strongest first. `mask`: of the level that
  /// they are looked for on, 0 where none; empty: everywhere.
  [[nodiscard]] static std::vector<cv::Point2f> corners(const ImagePyramid& image,
                                                        const cv::Mat& mask,
                                                        const FeatureOptions& options);

 protected:
  /// A point of an image, in that image's pixels.
  struct Point {
    cv::Point2f uv;
    int id = -1;
  };
  struct View {
    std::shared_ptr<const ImagePyramid> image;
    std::vector<Point> points;  ///< ordered by id
    int frame = -1;
    double time_s = 0.0;
    double interval_s = 0.0;  ///< from the image where its points were before
    /// The turn from there, as ImageClue::turn, where it led to the points.
    std::optional<Eigen::Matrix3d> turn = std::nullopt;
    /// The turn from here to the newest image.
    std::optional<Eigen::Matrix3d> turn_to_newest = Eigen::Matrix3d::Identity();
  };

  [[nodiscard]] const FeatureOptions& options() const { return options_; }
  /// Levels of a pyramid over an image of the given scale (input pixels per pixel): an image of
  /// half the input's size is its pyramid's second level.
  [[nodiscard]] int num_levels(double scale) const {
    return std::max(1, options_.klt_levels - std::ilogb(scale));
  }

 private:
  /// A new corner; false: it cannot be tracked.
  [[nodiscard]] virtual bool begin_track(const ImagePyramid& image, const Point& point) = 0;
  /// Where the points of `from` are in the next view, which has no points yet; nullopt: not found.
  [[nodiscard]] virtual std::vector<std::optional<cv::Point2f>> track_points(const View& from,
                                                                             View& to) = 0;
  /// A track that ended, near `point` of the image; nullopt: it is not there, and no more looked
  /// for, unless it `may_be_hidden`.
  [[nodiscard]] virtual std::optional<cv::Point2f> match_projection(const ImagePyramid& /*image*/,
                                                                    const Point& /*point*/,
                                                                    bool /*may_be_hidden*/) {
    return std::nullopt;
  }
  /// No track but those of these, each ordered by id, goes on.
  virtual void end_other_tracks(const std::vector<Point>& last,
                                const std::vector<Point>& good,
                                const Observations& expected) = 0;

  [[nodiscard]] Matches track(const View& from, View& to);
  void track_from_last_good(View& now, Matches& matches);
  [[nodiscard]] static bool is_lost(const Matches& matches, const View& from);
  void replenish(View& view);
  void match_projections(View& view);

  FeatureOptions options_;
  View last_;
  View last_good_;            ///< the one before nearly every track ended; none otherwise
  Observations projections_;  ///< in last_; empty once they were matched
  bool may_be_hidden_ = false;
  int next_id_ = 0;
};

}  // namespace stemvo
