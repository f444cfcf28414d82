// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include <opencv2/core.hpp>

#include "stem/model.hpp"
#include "stem/onnx_session.hpp"
#include "stem/stem.hpp"

namespace stemvo::internal {

/// How one axis of a convolution of stride s is sampled every s' pixels, s' a divisor of s: s / s'
/// passes over the frame shifted by 0, s', 2 s', .., whose outputs are interleaved. Output J looks
/// at the k pixels from s' J - before on.
///
/// The passes read one buffer, each from its own start. Where the graph pads, a pass would see
/// padding where the frame goes on, at another position in each pass; then the buffer holds a
/// margin of repeated border pixels instead, and outputs that touch the graph's padding are left
/// out.
struct SamplingAxis {
  int kernel = 1;
  int stride = 1;
  int sampling = 1;
  int before = 0;  ///< padding of the graph
  int after = 0;

  [[nodiscard]] int num_shifts() const { return stride / sampling; }
  [[nodiscard]] bool needs_margin() const { return num_shifts() > 1 && before + after > 0; }
  /// Whole strides, so that a margin moves the outputs by whole positions.
  [[nodiscard]] int margin_before() const {
    return needs_margin() ? stride * ((before + stride - 1) / stride) : 0;
  }
  [[nodiscard]] int margin_after() const { return needs_margin() ? after : 0; }
  [[nodiscard]] int buffer_size(int size) const { return margin_before() + size + margin_after(); }
  /// Size of the interleaved channel; 0 if the frame is smaller than the kernel.
  [[nodiscard]] int channel_size(int size) const { return outputs(size, sampling); }
  /// Size of the output of one pass over the buffer.
  [[nodiscard]] int pass_size(int size) const { return outputs(buffer_size(size), stride); }
  /// Outputs of each pass before the first that is kept.
  [[nodiscard]] int first_output() const { return margin_before() / stride; }
  /// Centre of the pixels that channel pixel 0 looks at.
  [[nodiscard]] double offset_px() const { return (kernel - 1) / 2.0 - before; }

 private:
  [[nodiscard]] int outputs(int size, int step) const {
    const int room = size + before + after - kernel;
    return room < 0 ? 0 : room / step + 1;
  }
};

/// Both axes; `sampling_px` divides the stride.
struct SamplingPlan {
  SamplingPlan(const ModelInfo& info, int sampling_px)
      : x{info.kernel_px[1], info.stride_px, sampling_px, info.padding_px[1], info.padding_px[3]},
        y{info.kernel_px[0], info.stride_px, sampling_px, info.padding_px[0], info.padding_px[2]},
        sees_windows_only(!info.native_sampling_only) {}

  SamplingAxis x;
  SamplingAxis y;
  bool sees_windows_only = true;  ///< an output depends on its window: checked when it is loaded

  [[nodiscard]] int num_passes() const { return x.num_shifts() * y.num_shifts(); }
  /// Column and row where pass `index` starts in the buffer; row-major.
  [[nodiscard]] cv::Point shift(int index) const {
    return {x.sampling * (index % x.num_shifts()), y.sampling * (index / x.num_shifts())};
  }
  [[nodiscard]] bool needs_margin() const { return x.needs_margin() || y.needs_margin(); }
  [[nodiscard]] cv::Size buffer_size(cv::Size frame) const {
    return {x.buffer_size(frame.width), y.buffer_size(frame.height)};
  }
  [[nodiscard]] cv::Size pass_size(cv::Size frame) const {
    return {x.pass_size(frame.width), y.pass_size(frame.height)};
  }
  [[nodiscard]] cv::Size channel_size(cv::Size frame) const {
    return {x.channel_size(frame.width), y.channel_size(frame.height)};
  }
  [[nodiscard]] PixelMap map() const {
    return {Eigen::Vector2d(x.sampling, y.sampling), {x.offset_px(), y.offset_px()}};
  }
};

/// The filters of a network's layer, sampled by `plan`. `label` is what messages call it;
/// `num_threads` as in Stem::load.
[[nodiscard]] FilterBank make_network_layer(const std::string& label,
                                            OnnxSession session,
                                            const SamplingPlan& plan,
                                            int num_threads);

}  // namespace stemvo::internal
