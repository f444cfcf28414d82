// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"

struct OrtApi;
struct OrtEnv;
struct OrtMemoryInfo;
struct OrtSession;
struct OrtStatus;
struct OrtTensorTypeAndShapeInfo;
struct OrtValue;

namespace stemvo::internal {

/// Something of ONNX Runtime, freed by the runtime's own release function.
template <typename T>
using OnnxHandle = std::unique_ptr<T, void (*)(T*)>;

/// A layer of a model, loaded: `image` 1xPxHxW float -> 1xCxhxw float, P = 3 (R, G, B) or 1 (gray).
/// The only class that sees ONNX Runtime. Single-threaded inside; `run` may be called from several
/// threads at once.
class OnnxSession {
 public:
  /// `model` holds the bytes of the .onnx file, `label` is what messages call it (its path).
  /// The output is the one called `layer`; a graph with one output may call it `channels`. Other
  /// outputs are computed and dropped. Errors: not a model, no such output (lists those there are),
  /// other names, element types, ranks or shapes than above.
  [[nodiscard]] static Expected<OnnxSession> create(const std::string& label,
                                                    std::string_view model,
                                                    const std::string& layer);

  /// Of the image: 3 or 1.
  [[nodiscard]] int num_planes() const { return num_planes_; }
  [[nodiscard]] int num_filters() const { return num_filters_; }
  /// The only size of image the graph takes; 0 where an axis is free.
  [[nodiscard]] cv::Size fixed_size() const { return fixed_size_; }

  /// Size of each channel for an image of this size, by asking the graph. Error: it refused, or
  /// its output is no 1xCxhxw.
  [[nodiscard]] Expected<cv::Size> channel_size(cv::Size image_size) const;

  /// One pass. `image`: num_planes() planes of image_size; `channels`: num_filters() planes of
  /// channel_size. Both are used where they are, without a copy. Error: the runtime refused.
  [[nodiscard]] Status run(const float* image,
                           cv::Size image_size,
                           float* channels,
                           cv::Size channel_size) const;

 private:
  struct TensorInfo;

  explicit OnnxSession(const std::string& label) : label_(label) {}
  [[nodiscard]] Status to_status(OrtStatus* raw) const;
  [[nodiscard]] Status load(std::string_view model);
  [[nodiscard]] Status check_input();
  [[nodiscard]] Status choose_output(const std::string& layer);
  [[nodiscard]] Status read_shape(const OrtTensorTypeAndShapeInfo* raw, TensorInfo& info) const;
  /// Input (or output) number `index` of the graph.
  [[nodiscard]] Expected<TensorInfo> read_tensor_info(bool is_input, std::size_t index) const;
  /// Around the caller's memory.
  [[nodiscard]] Expected<OnnxHandle<OrtValue>> make_tensor(const float* data,
                                                           int num_planes,
                                                           cv::Size size) const;
  /// A null output is made by the runtime.
  [[nodiscard]] Status run_graph(const OrtValue* input, OrtValue*& output) const;

  std::string label_;
  const OrtApi* api_ = nullptr;
  OnnxHandle<OrtEnv> env_{nullptr, nullptr};  // must outlive the session: declared before it
  OnnxHandle<OrtMemoryInfo> memory_{nullptr, nullptr};
  OnnxHandle<OrtSession> session_{nullptr, nullptr};
  std::string output_;
  int num_planes_ = 3;
  int num_filters_ = 0;
  cv::Size fixed_size_;
};

}  // namespace stemvo::internal
