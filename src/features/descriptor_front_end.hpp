// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "stemvo/features/front_end.hpp"

namespace stemvo {

/// Detect, describe, match by brute force: the paper's way (ORB) and the classic one (SIFT).
class DescriptorFrontEnd : public FrontEnd {
 public:
  enum class Kind { kOrb, kSift };
  DescriptorFrontEnd(Kind kind, const FeatureOptions& options);

  [[nodiscard]] Matches process(const ChannelImage& image) override;
  void keep(const std::vector<char>& is_good) override;

 private:
  struct Described {
    std::vector<Eigen::Vector2d> uv;  ///< input pixels
    std::vector<int> track_ids;       ///< -1: not matched with the picture before
    cv::Mat descriptors;              ///< one row per keypoint
    cv::Size size;                    ///< of the picture
  };

  [[nodiscard]] Described describe(const ChannelImage& image) const;
  [[nodiscard]] std::vector<cv::DMatch> match(const Described& prev, const Described& cur) const;

  Kind kind_;
  FeatureOptions options_;
  cv::Ptr<cv::Feature2D> feature_;
  Described last_;
  std::vector<std::size_t> matched_;  ///< keypoints of last_ that the last matches led to
  int num_tracks_ = 0;
};

}  // namespace stemvo
