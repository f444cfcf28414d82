// SPDX-License-Identifier: MIT
#pragma once

#include "support/test.hpp"

namespace stemvo::testing {

/// One of the models of tests/data/make_models.py.
struct TinyStem {
  std::string name;
  int filters = 3;
  int kernel = 4;
  int stride = 4;
  std::array<int, 4> padding{};  ///< top, left, bottom, right
  bool layer_norm = false;

  /// The formula of make_models.py.
  [[nodiscard]] double weight(int o, int c, int y, int x) const {
    if (o == 0) {
      return 1.0 / (3.0 * kernel * kernel);
    }
    return ((7 * o + 5 * c + 3 * y + 11 * x + o * x * y) % 13 - 6) / (20.0 * kernel);
  }
};

inline const TinyStem kPlain4{.name = "plain_k4s4"};
inline const TinyStem kNorm4{.name = "norm_k4s4", .filters = 6, .layer_norm = true};
inline const TinyStem kPadded3{
    .name = "plain_k3s2p1", .kernel = 3, .stride = 2, .padding = {1, 1, 1, 1}};
inline const TinyStem kSame3{
    .name = "plain_k3s2same", .kernel = 3, .stride = 2, .padding = {0, 0, 1, 1}};
inline const TinyStem kPadded7{
    .name = "plain_k7s2p3", .kernel = 7, .stride = 2, .padding = {3, 3, 3, 3}};
inline const TinyStem kFixed4{.name = "fixed_k4s4"};

/// The path of a model of make_models.py, as stem.model takes it.
inline std::string tiny_model(const std::string& name) {
  return STEMVO_SOURCE_DIR "/tests/data/stems/" + name + ".onnx";
}

/// A model's bytes with another text under `stemvo.KEY`: of two with one key the last counts.
inline std::string with_metadata(std::string model, std::string key, const std::string& value) {
  const auto field = [](char tag, const std::string& text) {
    return std::string{tag, static_cast<char>(text.size())} + text;
  };
  key.insert(0, "stemvo.");
  return model += field('\x72', field('\x0a', key) + field('\x12', value));
}

/// A textured frame with no symmetry, from sines: CV_8UC3 or CV_8UC1.
inline cv::Mat textured_frame(cv::Size size, int type) {
  cv::Mat frame(size, type);
  for (int y = 0; y < size.height; ++y) {
    for (int i = 0; i < size.width * frame.channels(); ++i) {
      const double x = i / frame.channels();
      const double phase = i % frame.channels();
      const double value = 60.0 * std::sin(0.31 * x + 0.17 * y + phase) +
                           50.0 * std::sin(0.07 * x * y / (3.0 + phase)) + 125.0;
      frame.ptr<unsigned char>(y)[i] = cv::saturate_cast<unsigned char>(value);
    }
  }
  return frame;
}

/// The layer in doubles at any stride; zeros outside the frame (after the mean was
/// taken off). One image per filter.
inline std::vector<cv::Mat1d> reference_channels(const TinyStem& stem,
                                                 const cv::Mat& frame,
                                                 int stride) {
  const auto [top, left, bottom, right] = stem.padding;
  cv::Mat centred = frame;
  if (frame.channels() == 1) {
    cv::cvtColor(frame, centred, cv::COLOR_GRAY2RGB);
  }
  centred.convertTo(centred, CV_64F);
  cv::subtract(centred, cv::Scalar(120.0, 115.0, 110.0), centred);
  cv::copyMakeBorder(centred, centred, top, bottom, left, right, cv::BORDER_CONSTANT);
  std::vector<cv::Mat1d> channels;
  cv::Mat1d mean = cv::Mat1d::zeros((centred.rows - stem.kernel) / stride + 1,
                                    (centred.cols - stem.kernel) / stride + 1);
  for (int o = 0; o < stem.filters; ++o) {
    cv::Mat3d weights(stem.kernel, stem.kernel);
    weights.forEach([&](cv::Vec3d& w, const int* at) {
      w = {stem.weight(o, 0, at[0], at[1]), stem.weight(o, 1, at[0], at[1]),
           stem.weight(o, 2, at[0], at[1])};
    });
    channels.emplace_back(mean.size()).forEach([&](double& value, const int* at) {
      value = weights.dot(centred({{stride * at[1], stride * at[0]}, weights.size()}));
    });
    mean += channels.back() / stem.filters;
  }
  if (stem.layer_norm) {
    cv::Mat1d variance(mean.size(), 1e-6);
    for (cv::Mat1d& channel : channels) {
      channel -= mean;
      variance += channel.mul(channel) / stem.filters;
    }
    cv::sqrt(variance, variance);
    for (cv::Mat1d& channel : channels) {
      channel /= variance;
    }
  }
  return channels;
}

/// Largest difference over the standard deviation.
inline double relative_error(const cv::Mat& found, const cv::Mat1d& expected) {
  cv::Mat1d values;
  found.convertTo(values, CV_64F);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(expected, mean, deviation);
  return cv::norm(values, expected, cv::NORM_INF) / deviation[0];
}

}  // namespace stemvo::testing
