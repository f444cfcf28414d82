// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <opencv2/core.hpp>

#include "features/front_end.hpp"

namespace stemvo {

/// Counts keypoints per cell of an image, so that no part of it takes all of them.
class GridQuota {
 public:
  /// Quota per cell = max_features / cells, at least 1.
  GridQuota(const FeatureOptions& options, cv::Size image_size)
      : columns_(options.grid_columns),
        rows_(options.grid_rows),
        quota_(std::max(1, options.max_features / (columns_ * rows_))),
        size_(image_size),
        counts_(static_cast<std::size_t>(columns_ * rows_), 0) {}

  /// Takes a place in the point's cell; false when the cell is full.
  bool take(const cv::Point2f& image_uv) {
    const auto cell = [](float position, int extent, int num_cells) {
      const int index =
          static_cast<int>(position * static_cast<float>(num_cells) / static_cast<float>(extent));
      return std::clamp(index, 0, num_cells - 1);
    };
    const int column = cell(image_uv.x, size_.width, columns_);
    const int row = cell(image_uv.y, size_.height, rows_);
    int& count = counts_[static_cast<std::size_t>(row * columns_ + column)];
    const bool has_room = count < quota_;
    count += has_room ? 1 : 0;
    return has_room;
  }

 private:
  int columns_;
  int rows_;
  int quota_;
  cv::Size size_;
  std::vector<int> counts_;
};

}  // namespace stemvo
