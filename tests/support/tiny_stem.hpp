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

inline std::filesystem::path tiny_stems() {
  return std::filesystem::path(STEMVO_SOURCE_DIR) / "tests/data/stems";
}

/// The path of a model of make_models.py, as stem.model takes it.
inline std::string tiny_model(const std::string& name) {
  return (tiny_stems() / (name + ".onnx")).string();
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

/// The layer in plain loops and doubles at any stride; zeros outside the frame (after the mean was
/// taken off). One image per filter.
inline std::vector<cv::Mat1d> reference_channels(const TinyStem& stem,
                                                 const cv::Mat& frame,
                                                 int stride) {
  const std::array<double, 3> mean = {120.0, 115.0, 110.0};
  const auto [top, left, bottom, right] = stem.padding;
  const cv::Size size((frame.cols + left + right - stem.kernel) / stride + 1,
                      (frame.rows + top + bottom - stem.kernel) / stride + 1);
  std::vector<cv::Mat1d> channels;
  for (int o = 0; o < stem.filters; ++o) {
    channels.emplace_back(size, 0.0);
  }
  const auto pixel = [&](int c, int y, int x) {
    const bool inside = y >= 0 && x >= 0 && y < frame.rows && x < frame.cols;
    const int plane = frame.channels() == 3 ? c : 0;
    return inside ? frame.ptr<unsigned char>(y)[x * frame.channels() + plane] -
                        mean.at(static_cast<std::size_t>(c))
                  : 0.0;
  };
  for (int row = 0; row < size.height; ++row) {
    for (int col = 0; col < size.width; ++col) {
      for (int o = 0; o < stem.filters; ++o) {
        double& sum = channels[static_cast<std::size_t>(o)](row, col);
        for (int i = 0; i < 3 * stem.kernel * stem.kernel; ++i) {
          const int c = i / (stem.kernel * stem.kernel);
          const int y = i / stem.kernel % stem.kernel;
          const int x = i % stem.kernel;
          sum +=
              stem.weight(o, c, y, x) * pixel(c, row * stride - top + y, col * stride - left + x);
        }
      }
      if (stem.layer_norm) {
        double m = 0.0;
        double v = 0.0;
        for (const cv::Mat1d& channel : channels) {
          m += channel(row, col) / stem.filters;
        }
        for (const cv::Mat1d& channel : channels) {
          v += std::pow(channel(row, col) - m, 2) / stem.filters;
        }
        for (cv::Mat1d& channel : channels) {
          channel(row, col) = (channel(row, col) - m) / std::sqrt(v + 1e-6);
        }
      }
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
