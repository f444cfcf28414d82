// SPDX-License-Identifier: MIT
#include "stem/onnx_session.hpp"

#include <algorithm>
#include <array>
#include <climits>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <onnxruntime_c_api.h>

#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::internal {

/// Name, type and shape of the graph's input or output.
struct OnnxSession::TensorInfo {
  std::string name;
  ONNXTensorElementDataType type = ONNX_TENSOR_ELEMENT_DATA_TYPE_UNDEFINED;
  std::vector<std::int64_t> shape;  // -1: free

  [[nodiscard]] std::string describe() const {
    const bool is_float = type == ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT;
    return fmt::format("{} {} {}", name, is_float ? "float" : "no float", fmt::join(shape, "x"));
  }

  /// A wanted size of -1 may be fixed or free in the graph.
  [[nodiscard]] bool is_float(const std::vector<std::int64_t>& wanted) const {
    return type == ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT &&
           std::equal(shape.begin(), shape.end(), wanted.begin(), wanted.end(),
                      [](std::int64_t size, std::int64_t wanted_size) {
                        return wanted_size < 0 ? size == -1 || size > 0 : size == wanted_size;
                      });
  }
};

namespace {

// The lowest version of the function table that has everything used here, so that a library older
// than the header still answers.
constexpr std::uint32_t kApiVersion = 5;
// A model may name other files for its weights. In a folder that does not exist it finds none.
constexpr const char* kFolderOfWeights = "session.model_external_initializers_file_folder_path";
constexpr const char* kInputName = "image";

}  // namespace

#define STEMVO_ORT_TRY(call) STEMVO_TRY(to_status(call))

/// The one function in which an OrtStatus becomes an Error (of one line) and is freed.
Status OnnxSession::to_status(OrtStatus* raw) const {
  if (raw == nullptr) {
    return {};
  }
  const OnnxHandle<OrtStatus> status(raw, api_->ReleaseStatus);
  const std::string message = api_->GetErrorMessage(raw);
  if (message.find("bad_alloc") != std::string::npos ||
      message.find("Failed to allocate memory") != std::string::npos) {
    throw std::bad_alloc();  // neither the model nor the frame is to blame
  }
  return fail(fmt::format("{}: ONNX Runtime: {}", label_, one_line(message)));
}

template <typename T, typename Create, typename... Given>
Expected<OnnxHandle<T>> OnnxSession::make(void (*release)(T*), Create call, Given... given) const {
  T* made = nullptr;
  STEMVO_ORT_TRY(call(given..., &made));
  return OnnxHandle<T>(made, release);
}

Expected<OnnxSession> OnnxSession::create(const std::string& label, std::string_view model) try {
  OnnxSession session(label);
  STEMVO_TRY(session.load(model));
  STEMVO_TRY(session.check_tensors());
  return session;
} catch (const std::bad_alloc&) {  // a size that the model asks for
  return fail(label + ": expected a model that fits into memory, found one that does not");
}

Status OnnxSession::load(std::string_view model) {
  const OrtApiBase* base = OrtGetApiBase();
  api_ = base->GetApi(kApiVersion);
  if (api_ == nullptr) {
    return fail(fmt::format("ONNX Runtime {}: expected function table version {}, found none",
                            base->GetVersionString(), kApiVersion));
  }
  // ONNX Runtime would send telemetry, and keep a file for it in the user's cache.
  ::setenv("ORT_DISABLE_TELEMETRY", "1", 0);
  // Fatal only: whatever goes wrong comes back as a status, and must not be printed twice.
  STEMVO_TRY_GET(env_, make(api_->ReleaseEnv, api_->CreateEnv, ORT_LOGGING_LEVEL_FATAL, "stemvo"));
  STEMVO_TRY_GET(memory_, make(api_->ReleaseMemoryInfo, api_->CreateCpuMemoryInfo,
                               OrtDeviceAllocator, OrtMemTypeDefault));
  STEMVO_TRY_GET(const auto options, make(api_->ReleaseSessionOptions, api_->CreateSessionOptions));
  // One thread per pass: the passes over shifted images run side by side instead, and no sum
  // depends on the number of threads.
  STEMVO_ORT_TRY(api_->SetSessionExecutionMode(options.get(), ORT_SEQUENTIAL));
  STEMVO_ORT_TRY(api_->SetIntraOpNumThreads(options.get(), 1));
  STEMVO_ORT_TRY(api_->SetInterOpNumThreads(options.get(), 1));
  STEMVO_ORT_TRY(api_->SetSessionGraphOptimizationLevel(options.get(), ORT_ENABLE_ALL));
  STEMVO_ORT_TRY(api_->SetSessionLogSeverityLevel(options.get(), ORT_LOGGING_LEVEL_FATAL));
  STEMVO_ORT_TRY(api_->AddSessionConfigEntry(options.get(), kFolderOfWeights, "/none"));
  STEMVO_TRY_GET(session_, make(api_->ReleaseSession, api_->CreateSessionFromArray, env_.get(),
                                model.data(), model.size(), options.get()));
  STEMVO_ORT_TRY(api_->GetAllocatorWithDefaultOptions(&allocator_));
  return {};
}

Expected<OnnxSession::TensorInfo> OnnxSession::read_tensor_info(bool is_input) const {
  const auto get_count = is_input ? api_->SessionGetInputCount : api_->SessionGetOutputCount;
  const auto get_name = is_input ? api_->SessionGetInputName : api_->SessionGetOutputName;
  const auto get_type = is_input ? api_->SessionGetInputTypeInfo : api_->SessionGetOutputTypeInfo;
  std::size_t count = 0;
  STEMVO_ORT_TRY(get_count(session_.get(), &count));
  if (count != 1) {
    return fail(
        fmt::format("{}: expected 1 {}, found {}", label_, is_input ? "input" : "output", count));
  }
  TensorInfo info;
  char* name = nullptr;
  STEMVO_ORT_TRY(get_name(session_.get(), 0, allocator_, &name));
  info.name = name;
  STEMVO_ORT_TRY(api_->AllocatorFree(allocator_, name));

  STEMVO_TRY_GET(const auto type, make(api_->ReleaseTypeInfo, get_type, session_.get(), 0U));
  ONNXType kind = ONNX_TYPE_UNKNOWN;
  STEMVO_ORT_TRY(api_->GetOnnxTypeFromTypeInfo(type.get(), &kind));
  if (kind != ONNX_TYPE_TENSOR) {
    return info;  // of no type
  }
  const OrtTensorTypeAndShapeInfo* tensor = nullptr;  // part of `type`
  STEMVO_ORT_TRY(api_->CastTypeInfoToTensorInfo(type.get(), &tensor));
  std::size_t rank = 0;
  STEMVO_ORT_TRY(api_->GetTensorElementType(tensor, &info.type));
  STEMVO_ORT_TRY(api_->GetDimensionsCount(tensor, &rank));
  info.shape.resize(rank);
  STEMVO_ORT_TRY(api_->GetDimensions(tensor, info.shape.data(), rank));
  return info;
}

Status OnnxSession::check_tensors() {
  STEMVO_TRY_GET(const auto input, read_tensor_info(true));
  const bool is_gray = input.is_float({1, 1, -1, -1});
  if (input.name != kInputName || (!is_gray && !input.is_float({1, 3, -1, -1}))) {
    return fail(fmt::format("{}: expected input '{} float 1x3xHxW' or 1x1xHxW, found '{}'", label_,
                            kInputName, input.describe()));
  }
  STEMVO_TRY_GET(const auto output, read_tensor_info(false));
  if (!output.is_float({1, -1, -1, -1}) || output.shape[1] < 1) {
    return fail(fmt::format("{}: expected output 'float 1xCxhxw' with C known, found '{}'", label_,
                            output.describe()));
  }
  const auto side_of = [&](std::size_t axis) {
    return static_cast<int>(std::clamp<std::int64_t>(input.shape[axis], 0, INT_MAX));
  };
  num_planes_ = is_gray ? 1 : 3;
  fixed_size_ = {side_of(3), side_of(2)};
  output_ = output.name;
  num_filters_ = static_cast<int>(output.shape[1]);
  return {};
}

Expected<std::string> OnnxSession::metadata(const std::string& key) const {
  STEMVO_TRY_GET(const auto metadata,
                 make(api_->ReleaseModelMetadata, api_->SessionGetModelMetadata, session_.get()));
  char* value = nullptr;
  STEMVO_ORT_TRY(
      api_->ModelMetadataLookupCustomMetadataMap(metadata.get(), allocator_, key.c_str(), &value));
  if (value == nullptr) {
    return std::string();
  }
  const std::string copy = value;
  STEMVO_ORT_TRY(api_->AllocatorFree(allocator_, value));
  return copy;
}

Expected<OnnxHandle<OrtValue>> OnnxSession::make_tensor(const float* data,
                                                        int num_planes,
                                                        cv::Size size) const {
  const std::array<std::int64_t, 4> shape = {1, num_planes, size.height, size.width};
  const std::size_t num_bytes =
      static_cast<std::size_t>(num_planes) * static_cast<std::size_t>(size.area()) * sizeof(float);
  // The table knows no constant data; the runtime only reads its inputs.
  return make(api_->ReleaseValue, api_->CreateTensorWithDataAsOrtValue, memory_.get(),
              const_cast<float*>(data), num_bytes, shape.data(), shape.size(),
              ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT);
}

Status OnnxSession::run(const float* image,
                        cv::Size image_size,
                        float* channels,
                        cv::Size channel_size) const {
  STEMVO_TRY_GET(const auto input, make_tensor(image, num_planes_, image_size));
  STEMVO_TRY_GET(const auto output, make_tensor(channels, num_filters_, channel_size));
  const char* const output_name = output_.c_str();
  const OrtValue* const raw_input = input.get();
  OrtValue* raw_output = output.get();
  return to_status(
      api_->Run(session_.get(), nullptr, &kInputName, &raw_input, 1, &output_name, 1, &raw_output));
}

}  // namespace stemvo::internal
