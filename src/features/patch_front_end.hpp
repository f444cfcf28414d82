// SPDX-License-Identifier: MIT
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "features/front_end.hpp"
#include "features/patch_alignment.hpp"

namespace stemvo {

/// Corners tracked from image to image by aligning the patch cut out when a point was new; cells
/// that lost points are refilled with new corners. A patch that has changed too much is cut out
/// anew where the point is; the track keeps its id.
class PatchFrontEnd final : public FrontEnd {
 public:
  explicit PatchFrontEnd(const FeatureOptions& options) : options_(options) {}

  using FrontEnd::process;
  [[nodiscard]] std::shared_ptr<const ImagePyramid> prepare(const ChannelImage& channel,
                                                            const cv::Mat& mask) const override;
  [[nodiscard]] Matches process(std::shared_ptr<const ImagePyramid> image,
                                const ImageClue& clue) override;
  void remove_outliers(const std::vector<char>& is_inlier) override;
  void expect_projections(Observations projections) override {
    projections_ = std::move(projections);
  }

  /// Where new points may begin: pixels of the image, strongest first. `mask`: of the level that
  /// they are looked for on, 0 where none; empty: everywhere.
  [[nodiscard]] static std::vector<cv::Point2f> corners(const ImagePyramid& image,
                                                        const cv::Mat& mask,
                                                        const FeatureOptions& options);

 private:
  struct PatchPyramid : ImagePyramid {
    using ImagePyramid::ImagePyramid;
    std::vector<BorderedImage> bordered;  ///< the levels, each in the middle of a larger image
  };
  /// A point of an image, in that image's pixels.
  struct Point {
    cv::Point2f uv;
    int id = -1;
  };
  struct View {
    std::shared_ptr<const PatchPyramid> image;
    std::vector<Point> points;  ///< ordered by id
    int frame = -1;
    double time_s = 0.0;
    double interval_s = 0.0;  ///< from the image where its points were before
    /// The turn from there, as ImageClue::turn, where it led to the points.
    std::optional<Eigen::Matrix3d> turn = std::nullopt;
    /// The turn from here to the newest image.
    std::optional<Eigen::Matrix3d> turn_to_newest = Eigen::Matrix3d::Identity();
  };
  struct Track {
    Patch patch;
    Similarity warp;     ///< from the patch to the last image it was found in
    cv::Point2f motion;  ///< to there, from the image before
    int frame = -1;      ///< the number of that image; -1: it is new
  };
  class Outlook;

  // Views (patch_views.cpp).
  [[nodiscard]] Matches track(const View& from, View& to);
  void track_from_last_good(View& now, Matches& matches);
  [[nodiscard]] static bool is_lost(const Matches& matches, const View& from);
  void replenish(View& view);
  void match_projections(View& view);

  // Patches (patch_front_end.cpp).
  /// A new corner; false: it cannot be tracked.
  [[nodiscard]] bool begin_track(const PatchPyramid& image, const Point& point);
  /// Where the points of `from` are in the next view, which has no points yet; nullopt: not found.
  [[nodiscard]] std::vector<std::optional<cv::Point2f>> track_points(const View& from, View& to);
  template <typename Align>
  [[nodiscard]] bool leads_to_points(const Outlook& outlook,
                                     const View& from,
                                     const Align& align,
                                     int top) const;
  [[nodiscard]] static bool accept(const PatchMatch& found,
                                   const PatchPyramid& image,
                                   int frame,
                                   const Point& from,
                                   Track& track);
  /// A track that ended, near `point` of the image; nullopt: it is not there.
  [[nodiscard]] std::optional<cv::Point2f> match_projection(const PatchPyramid& image,
                                                            const Point& point);
  /// No track but those of last_, last_good_ and projections_ goes on.
  void end_other_tracks();

  FeatureOptions options_;
  View last_;
  View last_good_;            ///< the one before nearly every track ended; none otherwise
  Observations projections_;  ///< in last_; empty once they were matched
  int next_id_ = 0;
  std::map<int, Track> tracks_;                         ///< by id
  std::vector<std::map<int, Track>::node_type> ended_;  ///< their memory is that of new ones
};

}  // namespace stemvo
