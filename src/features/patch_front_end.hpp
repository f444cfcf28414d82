// SPDX-License-Identifier: MIT
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "features/patch_alignment.hpp"
#include "features/point_front_end.hpp"

namespace stemvo {

/// Tracks by aligning the patch cut out when a point was new. A patch that has changed too much is
/// cut out anew where the point is; the track keeps its id.
class PatchFrontEnd final : public PointFrontEnd {
 public:
  using PointFrontEnd::PointFrontEnd;

  [[nodiscard]] std::shared_ptr<const ImagePyramid> prepare(const ChannelImage& channel,
                                                            const cv::Mat& mask) const override;

 private:
  struct PatchPyramid;
  class Outlook;
  struct Track {
    Patch patch;
    Similarity warp;     ///< from the patch to the last image it was found in
    cv::Point2f motion;  ///< to there, from the image before
    int frame = -1;      ///< the number of that image; -1: it is new
  };

  [[nodiscard]] bool begin_track(const ImagePyramid& image, const Point& point) override;
  [[nodiscard]] std::vector<std::optional<cv::Point2f>> track_points(const View& from,
                                                                     View& to) override;
  template <typename Align>
  [[nodiscard]] bool leads_to_points(const Outlook& outlook,
                                     const View& from,
                                     const Align& align,
                                     int top) const;
  [[nodiscard]] std::optional<cv::Point2f> match_projection(const ImagePyramid& image,
                                                            const Point& point) override;
  void end_other_tracks(const std::vector<Point>& last,
                        const std::vector<Point>& good,
                        const Observations& expected) override;
  [[nodiscard]] static bool accept(const PatchMatch& found,
                                   const PatchPyramid& image,
                                   int frame,
                                   const Point& from,
                                   Track& track);

  std::map<int, Track> tracks_;                         ///< by id
  std::vector<std::map<int, Track>::node_type> ended_;  ///< their memory is that of new ones
};

}  // namespace stemvo
