// SPDX-License-Identifier: MIT
#include "stem/hand_made.hpp"

#include <map>

#include <opencv2/imgproc.hpp>

namespace stemvo {
namespace {

using internal::FilterBank;
using internal::HandMadeBank;

/// 0.299 R + 0.587 G + 0.114 B, not rounded.
cv::Mat to_gray(const cv::Mat& frame) {
  cv::Mat values;
  frame.convertTo(values, CV_32F);  // first, so that gray is not rounded to 8 bit
  if (frame.channels() == 3) {
    cv::cvtColor(values.clone(), values, cv::COLOR_RGB2GRAY);
  }
  return values;
}

/// R, G, B as they are.
Expected<std::vector<Channel>> input_channels(const cv::Mat& frame, int first, int last) {
  std::vector<Channel> channels;
  for (int filter = first; filter < last; ++filter) {
    cv::Mat plane = frame;  // a gray frame has three equal colours
    if (frame.channels() == 3) {
      cv::extractChannel(frame, plane, filter);
    }
    plane.convertTo(channels.emplace_back().values, CV_32F);
  }
  return channels;
}

/// Laplacian of Gaussian at the size of what a tracker at half size resolves.
cv::Mat laplacian_of_gaussian(const cv::Mat& gray) {
  constexpr double kSigma_px = 2.0;
  cv::Mat smooth;
  cv::Mat values;
  cv::GaussianBlur(gray, smooth, {}, kSigma_px);
  cv::Laplacian(smooth, values, CV_32F);
  return values;
}

/// (gray - mean) / (standard deviation + floor) of the surroundings: what the census transform
/// compares, without its thresholds.
cv::Mat local_contrast(const cv::Mat& gray) {
  const cv::Size window(15, 15);
  constexpr double kFloor = 4.0;  // gray levels
  cv::Mat mean;
  cv::Mat square;
  cv::boxFilter(gray, mean, CV_32F, window);
  cv::boxFilter(gray.mul(gray), square, CV_32F, window);
  cv::Mat deviation = cv::max(square - mean.mul(mean), 0.0F);
  cv::sqrt(deviation, deviation);
  return (gray - mean) / (deviation + kFloor);
}

FilterBank of_gray(cv::Mat (*channel)(const cv::Mat& gray)) {
  return [channel](const cv::Mat& frame, int, int) -> Expected<std::vector<Channel>> {
    return std::vector<Channel>{{channel(to_gray(frame)), {}}};
  };
}

}  // namespace

bool is_hand_made(const std::string& model) { return internal::hand_made_bank(model).has_value(); }

std::optional<HandMadeBank> internal::hand_made_bank(const std::string& model) {
  static const std::map<std::string, HandMadeBank> kBanks = {
      {"gray", {1, of_gray([](const cv::Mat& gray) { return gray; })}},
      {"input_layer", {3, input_channels}},
      {"log", {1, of_gray(laplacian_of_gaussian)}},
      {"census", {1, of_gray(local_contrast)}}};
  const auto found = kBanks.find(model);
  return found != kBanks.end() ? std::optional(found->second) : std::nullopt;
}

}  // namespace stemvo
