// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "features/front_end.hpp"

namespace stemvo {

/// Detect, describe, match by brute force: the paper's way (ORB) and the classic one (SIFT).
class DescriptorFrontEnd : public FrontEnd {
 public:
  explicit DescriptorFrontEnd(const FeatureOptions& options);

  using FrontEnd::process;
  [[nodiscard]] std::shared_ptr<const ImagePyramid> prepare(const ChannelImage& channel,
                                                            const cv::Mat& mask) const override;
  [[nodiscard]] Matches process(std::shared_ptr<const ImagePyramid> image,
                                const ImageClue& clue) override;
  void remove_outliers(const std::vector<char>& is_inlier) override;

 private:
  struct Described : ImagePyramid {
    using ImagePyramid::ImagePyramid;
    std::vector<Eigen::Vector2d> uv;  ///< input pixels
    cv::Mat descriptors;              ///< one row per keypoint
  };

  [[nodiscard]] std::vector<cv::DMatch> match(const Described& prev, const Described& cur) const;

  FeatureOptions options_;
  cv::Ptr<cv::Feature2D> feature_;
  std::shared_ptr<const Described> last_;
  int last_frame_ = -1;
  std::vector<int> track_ids_;        ///< of last_'s keypoints; -1: not matched with those before
  std::vector<std::size_t> matched_;  ///< keypoints of last_ that the last matches led to
  int num_tracks_ = 0;
};

}  // namespace stemvo
