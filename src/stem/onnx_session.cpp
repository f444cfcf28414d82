// SPDX-License-Identifier: MIT
#include "stem/onnx_session.hpp"

#include <algorithm>
#include <array>
#include <climits>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <onnxruntime_c_api.h>

#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::internal {

/// Name, type and shape of one input or output of a graph.
struct OnnxSession::TensorInfo {
  std::string name;
  ONNXTensorElementDataType type = ONNX_TENSOR_ELEMENT_DATA_TYPE_UNDEFINED;
  std::vector<std::int64_t> shape;  // -1: free

  [[nodiscard]] std::string describe() const {
    std::vector<std::string> sizes;
    for (const std::int64_t size : shape) {
      sizes.push_back(size < 0 ? "?" : std::to_string(size));
    }
    const bool is_float = type == ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT;
    return fmt::format("{} {} {}", name, is_float ? "float" : "no float", fmt::join(sizes, "x"));
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
  const bool is_memory = message.find("bad_alloc") != std::string::npos ||
                         message.find("Failed to allocate memory") != std::string::npos;
  return fail(fmt::format("{}: {}ONNX Runtime: {}", label_, is_memory ? "out of memory: " : "",
                          one_line(message)),
              is_memory);
}

Expected<OnnxSession> OnnxSession::create(const std::string& label, std::string_view model) {
  OnnxSession session(label);
  STEMVO_TRY(session.load(model));
  STEMVO_TRY(session.check_input());
  STEMVO_TRY(session.check_output());
  return session;
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
  OrtEnv* env = nullptr;
  STEMVO_ORT_TRY(api_->CreateEnv(ORT_LOGGING_LEVEL_FATAL, "stemvo", &env));
  env_ = {env, api_->ReleaseEnv};
  OrtMemoryInfo* memory = nullptr;
  STEMVO_ORT_TRY(api_->CreateCpuMemoryInfo(OrtDeviceAllocator, OrtMemTypeDefault, &memory));
  memory_ = {memory, api_->ReleaseMemoryInfo};
  OrtSessionOptions* options = nullptr;
  STEMVO_ORT_TRY(api_->CreateSessionOptions(&options));
  const OnnxHandle<OrtSessionOptions> options_handle(options, api_->ReleaseSessionOptions);
  // One thread per pass: the passes over shifted images run side by side instead, and no sum
  // depends on the number of threads.
  STEMVO_ORT_TRY(api_->SetSessionExecutionMode(options, ORT_SEQUENTIAL));
  STEMVO_ORT_TRY(api_->SetIntraOpNumThreads(options, 1));
  STEMVO_ORT_TRY(api_->SetInterOpNumThreads(options, 1));
  STEMVO_ORT_TRY(api_->SetSessionGraphOptimizationLevel(options, ORT_ENABLE_ALL));
  STEMVO_ORT_TRY(api_->SetSessionLogSeverityLevel(options, ORT_LOGGING_LEVEL_FATAL));
  STEMVO_ORT_TRY(api_->AddSessionConfigEntry(options, kFolderOfWeights, "/none"));
  OrtSession* session = nullptr;
  STEMVO_ORT_TRY(api_->CreateSessionFromArray(env, model.data(), model.size(), options, &session));
  session_ = {session, api_->ReleaseSession};
  return {};
}

Expected<OnnxSession::TensorInfo> OnnxSession::read_tensor_info(bool is_input,
                                                                std::size_t index) const {
  TensorInfo info;
  OrtAllocator* allocator = nullptr;  // the runtime's own, never freed
  STEMVO_ORT_TRY(api_->GetAllocatorWithDefaultOptions(&allocator));
  char* name = nullptr;
  auto* const get_name = is_input ? api_->SessionGetInputName : api_->SessionGetOutputName;
  STEMVO_ORT_TRY(get_name(session_.get(), index, allocator, &name));
  info.name = name;
  STEMVO_ORT_TRY(api_->AllocatorFree(allocator, name));

  OrtTypeInfo* raw_type = nullptr;
  auto* const get_type = is_input ? api_->SessionGetInputTypeInfo : api_->SessionGetOutputTypeInfo;
  STEMVO_ORT_TRY(get_type(session_.get(), index, &raw_type));
  const OnnxHandle<OrtTypeInfo> type(raw_type, api_->ReleaseTypeInfo);
  ONNXType kind = ONNX_TYPE_UNKNOWN;
  STEMVO_ORT_TRY(api_->GetOnnxTypeFromTypeInfo(raw_type, &kind));
  if (kind != ONNX_TYPE_TENSOR) {
    return info;  // described as "no tensor"
  }
  const OrtTensorTypeAndShapeInfo* tensor = nullptr;  // part of `type`
  STEMVO_ORT_TRY(api_->CastTypeInfoToTensorInfo(raw_type, &tensor));
  std::size_t rank = 0;
  STEMVO_ORT_TRY(api_->GetTensorElementType(tensor, &info.type));
  STEMVO_ORT_TRY(api_->GetDimensionsCount(tensor, &rank));
  info.shape.resize(rank);
  STEMVO_ORT_TRY(api_->GetDimensions(tensor, info.shape.data(), rank));
  return info;
}

Status OnnxSession::check_input() {
  std::size_t inputs = 0;
  STEMVO_ORT_TRY(api_->SessionGetInputCount(session_.get(), &inputs));
  if (inputs != 1) {
    return fail(fmt::format("{}: expected 1 input, found {}", label_, inputs));
  }
  STEMVO_TRY_GET(const auto input, read_tensor_info(true, 0));
  const bool is_gray = input.is_float({1, 1, -1, -1});
  if (input.name != kInputName || (!is_gray && !input.is_float({1, 3, -1, -1}))) {
    return fail(fmt::format("{}: expected input '{} float 1x3xHxW' or 1x1xHxW, found '{}'", label_,
                            kInputName, input.describe()));
  }
  const auto side_of = [&](std::size_t axis) {
    return static_cast<int>(std::clamp<std::int64_t>(input.shape[axis], 0, INT_MAX));
  };
  num_planes_ = is_gray ? 1 : 3;
  fixed_size_ = {side_of(3), side_of(2)};
  return {};
}

Status OnnxSession::check_output() {
  std::size_t outputs = 0;
  STEMVO_ORT_TRY(api_->SessionGetOutputCount(session_.get(), &outputs));
  if (outputs != 1) {
    return fail(fmt::format("{}: expected 1 output, found {}", label_, outputs));
  }
  STEMVO_TRY_GET(const auto output, read_tensor_info(false, 0));
  if (!output.is_float({1, -1, -1, -1}) || output.shape[1] < 1) {
    return fail(fmt::format("{}: expected output 'float 1xCxhxw' with C known, found '{}'", label_,
                            output.describe()));
  }
  output_ = output.name;
  num_filters_ = static_cast<int>(output.shape[1]);
  return {};
}

Expected<std::optional<std::string>> OnnxSession::metadata(const std::string& key) const {
  OrtAllocator* allocator = nullptr;  // the runtime's own, never freed
  STEMVO_ORT_TRY(api_->GetAllocatorWithDefaultOptions(&allocator));
  OrtModelMetadata* raw = nullptr;
  STEMVO_ORT_TRY(api_->SessionGetModelMetadata(session_.get(), &raw));
  const OnnxHandle<OrtModelMetadata> metadata(raw, api_->ReleaseModelMetadata);
  char* value = nullptr;
  STEMVO_ORT_TRY(api_->ModelMetadataLookupCustomMetadataMap(raw, allocator, key.c_str(), &value));
  if (value == nullptr) {
    return std::optional<std::string>();
  }
  std::optional<std::string> copy = value;
  STEMVO_ORT_TRY(api_->AllocatorFree(allocator, value));
  return copy;
}

Expected<OnnxHandle<OrtValue>> OnnxSession::make_tensor(const float* data,
                                                        int num_planes,
                                                        cv::Size size) const {
  const std::array<std::int64_t, 4> shape = {1, num_planes, size.height, size.width};
  const std::size_t num_bytes =
      static_cast<std::size_t>(num_planes) * static_cast<std::size_t>(size.area()) * sizeof(float);
  OrtValue* raw = nullptr;
  // The table knows no constant data; the runtime only reads its inputs.
  STEMVO_ORT_TRY(api_->CreateTensorWithDataAsOrtValue(memory_.get(), const_cast<float*>(data),
                                                      num_bytes, shape.data(), shape.size(),
                                                      ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &raw));
  return OnnxHandle<OrtValue>(raw, api_->ReleaseValue);
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
