// SPDX-License-Identifier: MIT
#include <opencv2/imgproc.hpp>

#include "stem/filter_layer.hpp"

namespace stemvo::internal {
namespace {

class GrayLayer final : public FilterLayer {
 public:
  [[nodiscard]] Expected<std::vector<Channel>> apply(const cv::Mat& frame,
                                                     int first,
                                                     int last) const override {
    std::vector<Channel> channels(static_cast<std::size_t>(last - first));
    for (Channel& channel : channels) {
      frame.convertTo(channel.values, CV_32F);  // first, so that gray is not rounded to 8 bit
      if (frame.channels() == 3) {
        cv::cvtColor(channel.values.clone(), channel.values, cv::COLOR_RGB2GRAY);
      }
    }
    return channels;
  }
};

class InputLayer final : public FilterLayer {
 public:
  [[nodiscard]] Expected<std::vector<Channel>> apply(const cv::Mat& frame,
                                                     int first,
                                                     int last) const override {
    std::vector<Channel> channels;
    for (int filter = first; filter < last; ++filter) {
      cv::Mat plane = frame;  // a gray frame has three equal colours
      if (frame.channels() == 3) {
        cv::extractChannel(frame, plane, filter);
      }
      channels.emplace_back();
      plane.convertTo(channels.back().values, CV_32F);
    }
    return channels;
  }
};

}  // namespace

std::unique_ptr<FilterLayer> make_gray_layer() { return std::make_unique<GrayLayer>(); }
std::unique_ptr<FilterLayer> make_input_layer() { return std::make_unique<InputLayer>(); }

}  // namespace stemvo::internal
