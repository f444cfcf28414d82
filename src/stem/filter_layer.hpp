// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <vector>

#include <opencv2/core.hpp>

#include "stem/channel.hpp"
#include "stem/onnx_session.hpp"
#include "stem/sampling.hpp"
#include "stemvo/error.hpp"

namespace stemvo::internal {

/// A bank of filters over a frame (CV_8UC3 RGB or CV_8UC1), each giving one channel.
class FilterLayer {
 public:
  virtual ~FilterLayer() = default;
  /// The channels of filters [first, last). Error: see Stem::apply.
  [[nodiscard]] virtual Expected<std::vector<Channel>> apply(const cv::Mat& frame,
                                                             int first,
                                                             int last) const = 0;
};

/// One filter: 0.299 R + 0.587 G + 0.114 B, not rounded.
[[nodiscard]] std::unique_ptr<FilterLayer> make_gray_layer();
/// Three filters: R, G, B as they are.
[[nodiscard]] std::unique_ptr<FilterLayer> make_input_layer();
/// The filters of a network's first layer, sampled by `plan`. `label` is what messages call it.
[[nodiscard]] std::unique_ptr<FilterLayer> make_network_layer(std::string label,
                                                              OnnxSession session,
                                                              const SamplingPlan& plan);

}  // namespace stemvo::internal
