// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "features/front_end.hpp"
#include "features/patch_alignment.hpp"

namespace stemvo {

/// An image whose patches can be aligned. `levels` hold gray values, as detection wants them.
struct PatchPyramid : ImagePyramid {
  PatchPyramid(const ChannelImage& seen, int num_levels);

  /// The levels, each with a border; of the finest one the coefficients of its cubic spline.
  std::vector<BorderedImage> bordered;

 private:
  cv::Mat coefficients_;
};

}  // namespace stemvo
