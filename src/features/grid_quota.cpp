// SPDX-License-Identifier: MIT
#include "features/grid_quota.hpp"

#include <algorithm>

namespace stemvo {

GridQuota::GridQuota(const FeatureOptions& options, cv::Size image_size)
    : columns_(std::max(1, options.grid_columns)),
      rows_(std::max(1, options.grid_rows)),
      quota_(std::max(1, options.max_features / (columns_ * rows_))),
      size_(image_size),
      counts_(static_cast<std::size_t>(columns_ * rows_), 0) {}

std::size_t GridQuota::cell_of(const cv::Point2f& image_uv) const {
  const auto cell = [](float position, int extent, int num_cells) {
    const int index =
        static_cast<int>(position * static_cast<float>(num_cells) / static_cast<float>(extent));
    return std::clamp(index, 0, num_cells - 1);
  };
  const int column = cell(image_uv.x, size_.width, columns_);
  const int row = cell(image_uv.y, size_.height, rows_);
  return static_cast<std::size_t>(row * columns_ + column);
}

bool GridQuota::take(const cv::Point2f& image_uv) {
  int& count = counts_[cell_of(image_uv)];
  if (count >= quota_) {
    return false;
  }
  ++count;
  return true;
}

}  // namespace stemvo
