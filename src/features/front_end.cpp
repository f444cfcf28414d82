// SPDX-License-Identifier: MIT
#include "features/front_end.hpp"

#include <opencv2/imgproc.hpp>

namespace stemvo {

cv::Mat ImagePyramid::mask_of(const PixelMap& map, cv::Size size) const {
  cv::Mat result;
  if (!mask.empty()) {
    const cv::Matx23d to_input(map.scale.x(), 0.0, map.offset_px.x(), 0.0, map.scale.y(),
                               map.offset_px.y());
    cv::warpAffine(mask, result, to_input, size, cv::INTER_NEAREST | cv::WARP_INVERSE_MAP,
                   cv::BORDER_REPLICATE);
  }
  return result;
}

std::unique_ptr<FrontEnd> create_front_end(const FeatureOptions& options) {
  return options.method == FeatureMethod::kPatch ? create_patch_front_end(options)
         : options.method == FeatureMethod::kKlt ? create_klt_front_end(options)
                                                 : create_descriptor_front_end(options);
}

}  // namespace stemvo
