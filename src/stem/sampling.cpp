// SPDX-License-Identifier: MIT
#include "stem/sampling.hpp"

#include "internal_check.hpp"

namespace stemvo::internal {

SamplingPlan::SamplingPlan(const StemNetwork& network, int sampling_px)
    : x{network.kernel_px[1], network.stride_px, sampling_px, network.padding_px[1],
        network.padding_px[3]},
      y{network.kernel_px[0], network.stride_px, sampling_px, network.padding_px[0],
        network.padding_px[2]},
      sees_windows_only(!network.native_sampling_only) {
  STEMVO_CHECK(sampling_px >= 1 && network.stride_px % sampling_px == 0,
               "sampling divides the stride");
}

PixelMap SamplingPlan::map() const {
  PixelMap map;
  map.scale = Eigen::Vector2d(x.sampling, y.sampling);
  map.offset_px = Eigen::Vector2d((x.kernel - 1) / 2.0 - x.before, (y.kernel - 1) / 2.0 - y.before);
  return map;
}

void SamplingPlan::interleave(int index, const cv::Mat1f& pass, cv::Mat1f& channel) const {
  const int step_x = x.num_shifts();
  const int step_y = y.num_shifts();
  for (int row = index / step_x, from = y.first_output(); row < channel.rows;
       row += step_y, ++from) {
    const float* source = pass[from] + x.first_output();
    float* const target = channel[row];
    for (int col = index % step_x; col < channel.cols; col += step_x) {
      target[col] = *source++;
    }
  }
}

}  // namespace stemvo::internal
