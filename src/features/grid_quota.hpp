// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "features/front_end.hpp"

namespace stemvo {

/// Counts keypoints per cell of an image, so that no part of it takes all of them.
class GridQuota {
 public:
  /// Quota per cell = max_features / cells, at least 1.
  GridQuota(const FeatureOptions& options, cv::Size image_size);

  /// Takes a place in the point's cell; false when the cell is full.
  bool take(const cv::Point2f& image_uv);

 private:
  [[nodiscard]] std::size_t cell_of(const cv::Point2f& image_uv) const;

  int columns_;
  int rows_;
  int quota_;
  cv::Size size_;
  std::vector<int> counts_;
};

}  // namespace stemvo
