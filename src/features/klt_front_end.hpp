// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "stemvo/features/front_end.hpp"

namespace stemvo {

/// Corners followed by pyramidal Lucas-Kanade (Bouguet 2001), there and back; cells that lost
/// points are refilled with new corners.
class KltFrontEnd : public FrontEnd {
 public:
  explicit KltFrontEnd(const FeatureOptions& options) : options_(options) {}

  [[nodiscard]] Matches process(const ChannelImage& image) override;
  void keep(const std::vector<char>& is_good) override;

 private:
  /// A point of the last picture, in that picture's pixels.
  struct Point {
    cv::Point2f uv;
    int id = -1;
  };

  [[nodiscard]] Matches track(const ChannelImage& image, const std::vector<cv::Mat>& pyramid);
  void replenish(const cv::Mat& picture);
  [[nodiscard]] std::vector<cv::Mat> build_pyramid(const cv::Mat& picture) const;

  FeatureOptions options_;
  std::vector<cv::Mat> pyramid_;  ///< of the last picture
  cv::Mat picture_;               ///< the last picture
  PixelMap map_;                  ///< of the last picture
  std::vector<Point> points_;     ///< on the last picture
  int next_id_ = 0;
};

}  // namespace stemvo
