// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stemvo/error.hpp"
#include "stemvo/stem/channel.hpp"

namespace stemvo {

/// Keys `stem.*` of the configuration.
struct StemOptions {
  /// Name in models/manifest.yaml, path of an .onnx (with a manifest.yaml beside it), `gray`, or
  /// `input_layer` (filters 0, 1, 2 = R, G, B).
  std::string model = "default";
  std::string layer = "first";  ///< of a model that has several, by name
  int filter = -1;              ///< -1: the manifest's default_filter (gray, input_layer: 0)
  int sampling_px = 0;          ///< divisor of the native stride; 0: 2 if it divides it, else 1
  /// `bicubic` (to the input's size), `half` (bicubic to half of it, where the channel is coarser
  /// than that; else native), `native`, or `auto`: with_chosen_upsample() of config.hpp says which
  /// (here: bicubic).
  std::string upsample = "auto";
  double stretch_low_percent = 0.5;  ///< percentiles mapped to 0 and 255
  double stretch_high_percent = 99.5;
  double stretch_memory = 0.95;  ///< share of the last limits kept at each frame
};

/// What is known of the loaded network, for reports (config.yaml, metrics.json).
struct StemInfo {
  std::string model;   ///< as asked for
  std::string layer;   ///< empty for gray and input_layer
  std::string sha256;  ///< of the .onnx file, empty for gray and input_layer
  int filter = 0;      ///< the one chosen, never -1
  int num_filters = 1;
  int native_stride_px = 1;
  int sampling_px = 1;
};

/// One filter of the first layer of a network: frame in, channel out. Movable; `apply` is const and
/// gives the same bytes whatever the number of threads (cv::setNumThreads).
class Stem {
 public:
  /// Loads and checks the model. Errors: unknown name (lists the known ones), hash other than in
  /// the manifest, not ONNX, inputs or outputs other than 1x3xHxW -> 1xCxhxw float, unknown layer
  /// (lists the known ones), filter outside [0, C), sampling_px not a divisor of the stride (lists
  /// the allowed values).
  [[nodiscard]] static Expected<Stem> create(const StemOptions& options,
                                             const std::filesystem::path& models_dir);

  Stem(Stem&&) noexcept;
  Stem& operator=(Stem&&) noexcept;
  ~Stem();

  [[nodiscard]] const StemInfo& info() const;
  /// Frame: CV_8UC3 in RGB order or CV_8UC1 (replicated to three planes). The one filter chosen,
  /// from its own file where the manifest has one (`folded`).
  /// Error: the frame is smaller than the kernel, or the runtime refused it.
  [[nodiscard]] Expected<Channel> apply(const cv::Mat& frame) const;
  /// All filters of the layer from one pass, in order.
  [[nodiscard]] Expected<std::vector<Channel>> apply_all(const cv::Mat& frame) const;
  /// Filters [first, last) of the layer from one pass: no more memory than theirs.
  /// 0 <= first < last <= info().num_filters.
  [[nodiscard]] Expected<std::vector<Channel>> apply_range(const cv::Mat& frame,
                                                           int first,
                                                           int last) const;

 private:
  struct Impl;
  explicit Stem(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Float channel -> 8-bit picture: percentile limits that follow the drive slowly, so that a patch
/// keeps its gray value from frame to frame; then bicubic upsampling by the whole factor that
/// brings it to the input's size, or half of it (PixelMap is adjusted; no resampling between
/// pixels). A channel without contrast becomes one gray and leaves the limits as they were; NaN
/// becomes 0 (upsampled: its surroundings too).
class ChannelStretch {
 public:
  explicit ChannelStretch(const StemOptions& options);
  [[nodiscard]] ChannelImage apply(const Channel& channel);

 private:
  StemOptions options_;
  bool has_limits_ = false;
  double low_ = 0.0;
  double high_ = 1.0;
  cv::Mat upsampled_;  ///< buffer
};

}  // namespace stemvo
