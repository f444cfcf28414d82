// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"

struct OrtAllocator;
struct OrtApi;
struct OrtEnv;
struct OrtMemoryInfo;
struct OrtSession;
struct OrtStatus;
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
  /// Errors: not a model, more than one input or output, other names, element types, ranks or
  /// shapes than above, weights in another file.
  [[nodiscard]] static Expected<OnnxSession> create(const std::string& label,
                                                    std::string_view model);

  /// The model's metadata_props under this key; empty: none.
  [[nodiscard]] Expected<std::string> metadata(const std::string& key) const;
  /// Planes of the image: 3 or 1.
  [[nodiscard]] int num_planes() const { return num_planes_; }
  [[nodiscard]] int num_filters() const { return num_filters_; }
  /// The only size of image the graph takes; 0 where an axis is free.
  [[nodiscard]] cv::Size fixed_size() const { return fixed_size_; }

  /// One pass. `image`: num_planes() planes of image_size; `channels`: num_filters() planes of
  /// channel_size. Both are used where they are, without a copy. Error: the runtime refused,
  /// the graph makes channels of another size.
  [[nodiscard]] Status run(const float* image,
                           cv::Size image_size,
                           float* channels,
                           cv::Size channel_size) const;

 private:
  struct TensorInfo;

  explicit OnnxSession(const std::string& label) : label_(label) {}
  [[nodiscard]] Status to_status(OrtStatus* raw) const;
  [[nodiscard]] Status load(std::string_view model);
  [[nodiscard]] Status check_tensors();
  /// The graph's input or output. Error: it has more or none.
  [[nodiscard]] Expected<TensorInfo> read_tensor_info(bool is_input) const;
  /// Calls a function of the runtime's table with the rest; owns what it makes.
  template <typename T, typename Create, typename... Given>
  [[nodiscard]] Expected<OnnxHandle<T>> make(void (*release)(T*),
                                             Create call,
                                             Given... given) const;
  /// Around the caller's memory.
  [[nodiscard]] Expected<OnnxHandle<OrtValue>> make_tensor(const float* data,
                                                           int num_planes,
                                                           cv::Size size) const;

  std::string label_;
  const OrtApi* api_ = nullptr;
  OrtAllocator* allocator_ = nullptr;         // the runtime's own, never freed
  OnnxHandle<OrtEnv> env_{nullptr, nullptr};  // must outlive the session: declared before it
  OnnxHandle<OrtMemoryInfo> memory_{nullptr, nullptr};
  OnnxHandle<OrtSession> session_{nullptr, nullptr};
  std::string output_;
  int num_planes_ = 3;
  int num_filters_ = 0;
  cv::Size fixed_size_;
};

}  // namespace stemvo::internal
