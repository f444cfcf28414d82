// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "stem/onnx_session.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// A model file's statements on its one layer, from its metadata (`stemvo.kernel` ..).
struct ModelInfo {
  std::string network;  ///< e.g. "EfficientNetV2-B0"
  std::string layer;
  std::string licence;
  std::string command;  ///< that made the file
  int num_filters = 0;
  int default_filter = 0;
  /// The file holds this one of the layer's filters alone: the same values at less cost.
  std::optional<int> only_filter;
  std::array<int, 2> kernel_px{};  ///< y, x
  int stride_px = 0;
  std::array<int, 4> padding_px{};  ///< top, left, bottom, right, inside the graph
  /// A deeper layer, padded inside or seeing more than its window, so that passes over a shifted
  /// frame would not fit together. Kernel and padding then are those of one convolution with the
  /// same centre and the same sizes of channels.
  bool native_sampling_only = false;
};

/// Models that are part of the library.
[[nodiscard]] std::vector<std::string> built_in_models();

/// The .onnx file of a built-in model, or that of a path. Error: neither, or it cannot be read.
[[nodiscard]] Expected<std::string> read_model(const std::string& model);

/// Reads the file's statements, without the checks of open_model.
[[nodiscard]] Expected<ModelInfo> read_model_info(const std::string& model);

namespace internal {

struct Model {
  std::string label;  ///< for messages
  ModelInfo info;
  OnnxSession session;
};

/// Loads a model and holds its graph against what it says: number of filters, stride and sizes of
/// channels; where it may be sampled more densely, also that an output depends on the pixels of the
/// window of kernel, stride and padding and on no others. So the pixel map is right, and passes
/// over a shifted frame agree (a graph that normalises over the whole image, say, is refused).
[[nodiscard]] Expected<Model> open_model(const std::string& model);

}  // namespace internal
}  // namespace stemvo
