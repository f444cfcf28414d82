// SPDX-License-Identifier: MIT
#include "stem/onnx_session.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <onnxruntime_c_api.h>

namespace stemvo::internal {
namespace {

// The lowest version of the function table that has everything used here, so that a library older
// than the header still answers.
constexpr std::uint32_t kApiVersion = 1;
constexpr const char* kInputName = "image";
constexpr const char* kOnlyOutput = "channels";

/// The one place where an OrtStatus becomes an Error (of one line) and is freed.
Status to_status(const OrtApi& api, const std::string& label, OrtStatus* raw) {
  if (raw == nullptr) {
    return {};
  }
  const OnnxHandle<OrtStatus> status(raw, api.ReleaseStatus);
  std::string message = api.GetErrorMessage(raw);
  std::replace(message.begin(), message.end(), '\n', ' ');
  return fail(fmt::format("{}: ONNX Runtime: {}", label, message));
}

// Returns from the calling function with the Error, if there is one.
#define STEMVO_ORT_TRY(api, label, call)                          \
  do {                                                            \
    if (Status status_ = to_status(api, label, call); !status_) { \
      return status_.error();                                     \
    }                                                             \
  } while (false)

Expected<const OrtApi*> find_api() {
  const OrtApiBase* base = OrtGetApiBase();
  const OrtApi* api = base->GetApi(kApiVersion);
  if (api == nullptr) {
    return fail(fmt::format("ONNX Runtime {}: expected function table version {}, found none",
                            base->GetVersionString(), kApiVersion));
  }
  return api;
}

/// What a graph says of one input or output.
struct TensorInfo {
  std::string name;
  ONNXTensorElementDataType type = ONNX_TENSOR_ELEMENT_DATA_TYPE_UNDEFINED;
  std::vector<std::int64_t> shape;  // -1: free
};

std::string type_name(ONNXTensorElementDataType type) {
  static constexpr std::array kNames = {"no tensor", "float", "uint8",   "int8",
                                        "uint16",    "int16", "int32",   "int64",
                                        "string",    "bool",  "float16", "double"};
  const auto index = static_cast<std::size_t>(type);
  return index < kNames.size() ? kNames[index] : fmt::format("element type {}", index);
}

std::string describe(const TensorInfo& info) {
  std::vector<std::string> sizes;
  for (const std::int64_t size : info.shape) {
    sizes.push_back(size < 0 ? "?" : std::to_string(size));
  }
  return fmt::format("{} {} {}", info.name, type_name(info.type), fmt::join(sizes, "x"));
}

Status read_shape(const OrtApi& api,
                  const std::string& label,
                  const OrtTensorTypeAndShapeInfo* info,
                  TensorInfo& out) {
  std::size_t rank = 0;
  STEMVO_ORT_TRY(api, label, api.GetTensorElementType(info, &out.type));
  STEMVO_ORT_TRY(api, label, api.GetDimensionsCount(info, &rank));
  out.shape.resize(rank);
  STEMVO_ORT_TRY(api, label, api.GetDimensions(info, out.shape.data(), rank));
  return {};
}

/// Input (or output) number `index` of the graph.
Expected<TensorInfo> read_tensor_info(const OrtApi& api,
                                      const std::string& label,
                                      const OrtSession* session,
                                      bool is_input,
                                      std::size_t index) {
  TensorInfo info;
  OrtAllocator* allocator = nullptr;  // the runtime's own, never freed
  STEMVO_ORT_TRY(api, label, api.GetAllocatorWithDefaultOptions(&allocator));
  char* name = nullptr;
  auto* const get_name = is_input ? api.SessionGetInputName : api.SessionGetOutputName;
  STEMVO_ORT_TRY(api, label, get_name(session, index, allocator, &name));
  info.name = name;
  STEMVO_ORT_TRY(api, label, api.AllocatorFree(allocator, name));

  OrtTypeInfo* raw_type = nullptr;
  auto* const get_type = is_input ? api.SessionGetInputTypeInfo : api.SessionGetOutputTypeInfo;
  STEMVO_ORT_TRY(api, label, get_type(session, index, &raw_type));
  const OnnxHandle<OrtTypeInfo> type(raw_type, api.ReleaseTypeInfo);
  ONNXType kind = ONNX_TYPE_UNKNOWN;
  STEMVO_ORT_TRY(api, label, api.GetOnnxTypeFromTypeInfo(raw_type, &kind));
  if (kind != ONNX_TYPE_TENSOR) {
    return info;  // described as "no tensor"
  }
  const OrtTensorTypeAndShapeInfo* tensor = nullptr;  // part of `type`
  STEMVO_ORT_TRY(api, label, api.CastTypeInfoToTensorInfo(raw_type, &tensor));
  if (Status status = read_shape(api, label, tensor, info); !status) {
    return status.error();
  }
  return info;
}

Expected<OnnxHandle<OrtSessionOptions>> make_options(const OrtApi& api, const std::string& label) {
  OrtSessionOptions* raw = nullptr;
  STEMVO_ORT_TRY(api, label, api.CreateSessionOptions(&raw));
  OnnxHandle<OrtSessionOptions> options(raw, api.ReleaseSessionOptions);
  // One thread per pass: the passes over shifted pictures run side by side instead, and no sum
  // depends on the number of threads.
  STEMVO_ORT_TRY(api, label, api.SetSessionExecutionMode(raw, ORT_SEQUENTIAL));
  STEMVO_ORT_TRY(api, label, api.SetIntraOpNumThreads(raw, 1));
  STEMVO_ORT_TRY(api, label, api.SetInterOpNumThreads(raw, 1));
  STEMVO_ORT_TRY(api, label, api.SetSessionGraphOptimizationLevel(raw, ORT_ENABLE_ALL));
  STEMVO_ORT_TRY(api, label, api.SetSessionLogSeverityLevel(raw, ORT_LOGGING_LEVEL_FATAL));
  return options;
}

bool is_fixed_or_free(std::int64_t size, std::int64_t wanted) {
  return wanted < 0 ? size == -1 || size > 0 : size == wanted;
}

/// A wanted size of -1 may be fixed or free in the graph.
bool fits(const TensorInfo& info, const char* name, const std::vector<std::int64_t>& wanted) {
  return info.name == name && info.type == ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT &&
         std::equal(info.shape.begin(), info.shape.end(), wanted.begin(), wanted.end(),
                    is_fixed_or_free);
}

}  // namespace

OnnxSession::OnnxSession(std::string label,
                         const OrtApi& api,
                         OnnxHandle<OrtEnv> env,
                         OnnxHandle<OrtMemoryInfo> memory,
                         OnnxHandle<OrtSession> session)
    : label_(std::move(label)),
      api_(&api),
      env_(std::move(env)),
      memory_(std::move(memory)),
      session_(std::move(session)) {}

Expected<OnnxSession> OnnxSession::create(const std::string& label,
                                          std::string_view model,
                                          const std::string& layer) {
  const auto found = find_api();
  if (!found) {
    return found.error();
  }
  const OrtApi& api = **found;
  // Fatal only: whatever goes wrong comes back as a status, and must not be printed twice.
  OrtEnv* raw_env = nullptr;
  STEMVO_ORT_TRY(api, label, api.CreateEnv(ORT_LOGGING_LEVEL_FATAL, "stemvo", &raw_env));
  OnnxHandle<OrtEnv> env(raw_env, api.ReleaseEnv);
  OrtMemoryInfo* raw_memory = nullptr;
  STEMVO_ORT_TRY(api, label,
                 api.CreateCpuMemoryInfo(OrtDeviceAllocator, OrtMemTypeDefault, &raw_memory));
  OnnxHandle<OrtMemoryInfo> memory(raw_memory, api.ReleaseMemoryInfo);
  auto options = make_options(api, label);
  if (!options) {
    return options.error();
  }
  OrtSession* raw_session = nullptr;
  STEMVO_ORT_TRY(api, label,
                 api.CreateSessionFromArray(raw_env, model.data(), model.size(), options->get(),
                                            &raw_session));
  OnnxHandle<OrtSession> handle(raw_session, api.ReleaseSession);

  OnnxSession session(label, api, std::move(env), std::move(memory), std::move(handle));
  Status status = session.check_input();
  if (status) {
    status = session.choose_output(layer);
  }
  if (!status) {
    return status.error();
  }
  return session;
}

Status OnnxSession::check_input() {
  std::size_t inputs = 0;
  STEMVO_ORT_TRY(*api_, label_, api_->SessionGetInputCount(session_.get(), &inputs));
  if (inputs != 1) {
    return fail(fmt::format("{}: expected 1 input, found {}", label_, inputs));
  }
  const auto input = read_tensor_info(*api_, label_, session_.get(), true, 0);
  if (!input) {
    return input.error();
  }
  const bool is_gray = fits(*input, kInputName, {1, 1, -1, -1});
  if (!is_gray && !fits(*input, kInputName, {1, 3, -1, -1})) {
    return fail(fmt::format("{}: expected input '{} float 1x3xHxW' or 1x1xHxW, found '{}'", label_,
                            kInputName, describe(*input)));
  }
  num_planes_ = is_gray ? 1 : 3;
  fixed_size_ = {static_cast<int>(std::max<std::int64_t>(input->shape[3], 0)),
                 static_cast<int>(std::max<std::int64_t>(input->shape[2], 0))};
  return {};
}

Status OnnxSession::choose_output(const std::string& layer) {
  std::size_t count = 0;
  STEMVO_ORT_TRY(*api_, label_, api_->SessionGetOutputCount(session_.get(), &count));
  std::vector<std::string> known;
  for (std::size_t i = 0; i < count; ++i) {
    const auto output = read_tensor_info(*api_, label_, session_.get(), false, i);
    if (!output) {
      return output.error();
    }
    known.push_back(describe(*output));
    if (output->name != layer && (count > 1 || output->name != kOnlyOutput)) {
      continue;
    }
    if (!fits(*output, output->name.c_str(), {1, -1, -1, -1}) || output->shape[1] < 1) {
      return fail(fmt::format("{}: expected output '{} float 1xCxhxw' with C known, found '{}'",
                              label_, output->name, describe(*output)));
    }
    output_ = output->name;
    num_filters_ = static_cast<int>(output->shape[1]);
    return {};
  }
  return fail(fmt::format("{}: expected an output '{}'{}, found '{}'", label_, layer,
                          count > 1 ? "" : fmt::format(" or '{}'", kOnlyOutput),
                          fmt::join(known, "', '")));
}

Expected<cv::Size> OnnxSession::channel_size(cv::Size image_size) const {
  std::vector<float> zeros(static_cast<std::size_t>(num_planes_ * image_size.area()));
  const std::array<std::int64_t, 4> shape = {1, num_planes_, image_size.height, image_size.width};
  OrtValue* raw_input = nullptr;
  STEMVO_ORT_TRY(*api_, label_,
                 api_->CreateTensorWithDataAsOrtValue(
                     memory_.get(), zeros.data(), zeros.size() * sizeof(float), shape.data(),
                     shape.size(), ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &raw_input));
  const OnnxHandle<OrtValue> input(raw_input, api_->ReleaseValue);
  const OrtValue* const inputs[] = {raw_input};
  const char* const output_name = output_.c_str();
  OrtValue* raw_output = nullptr;  // null: the runtime makes it, of the size we ask for
  STEMVO_ORT_TRY(
      *api_, label_,
      api_->Run(session_.get(), nullptr, &kInputName, inputs, 1, &output_name, 1, &raw_output));
  const OnnxHandle<OrtValue> output(raw_output, api_->ReleaseValue);
  OrtTensorTypeAndShapeInfo* raw_info = nullptr;
  STEMVO_ORT_TRY(*api_, label_, api_->GetTensorTypeAndShape(raw_output, &raw_info));
  const OnnxHandle<OrtTensorTypeAndShapeInfo> info(raw_info, api_->ReleaseTensorTypeAndShapeInfo);
  TensorInfo found;
  if (Status status = read_shape(*api_, label_, raw_info, found); !status) {
    return status.error();
  }
  return cv::Size(static_cast<int>(found.shape.at(3)), static_cast<int>(found.shape.at(2)));
}

Status OnnxSession::run(const float* image,
                        cv::Size image_size,
                        float* channels,
                        cv::Size channel_size) const {
  const std::array<std::int64_t, 4> in_shape = {1, num_planes_, image_size.height,
                                                image_size.width};
  const std::array<std::int64_t, 4> out_shape = {1, num_filters_, channel_size.height,
                                                 channel_size.width};
  const std::size_t in_bytes =
      static_cast<std::size_t>(num_planes_ * image_size.area()) * sizeof(float);
  const std::size_t out_bytes = static_cast<std::size_t>(num_filters_) *
                                static_cast<std::size_t>(channel_size.area()) * sizeof(float);
  OrtValue* raw_input = nullptr;
  // The table knows no constant data; the runtime only reads its inputs.
  STEMVO_ORT_TRY(*api_, label_,
                 api_->CreateTensorWithDataAsOrtValue(
                     memory_.get(), const_cast<float*>(image), in_bytes, in_shape.data(),
                     in_shape.size(), ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &raw_input));
  const OnnxHandle<OrtValue> input(raw_input, api_->ReleaseValue);
  const char* const output_name = output_.c_str();
  OrtValue* raw_output = nullptr;
  STEMVO_ORT_TRY(*api_, label_,
                 api_->CreateTensorWithDataAsOrtValue(
                     memory_.get(), channels, out_bytes, out_shape.data(), out_shape.size(),
                     ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &raw_output));
  const OnnxHandle<OrtValue> output(raw_output, api_->ReleaseValue);
  const OrtValue* const inputs[] = {raw_input};
  STEMVO_ORT_TRY(
      *api_, label_,
      api_->Run(session_.get(), nullptr, &kInputName, inputs, 1, &output_name, 1, &raw_output));
  return {};
}

}  // namespace stemvo::internal
