// SPDX-License-Identifier: MIT
// Calls every function that third_party/onnxruntime/onnxruntime_c_api.h declares, against the real
// library: a function at a wrong place of the table, or with a wrong type, cannot pass.
#include <array>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <onnxruntime_c_api.h>

namespace {

using ::testing::ElementsAre;
using ::testing::FloatNear;
using ::testing::HasSubstr;

std::string read_model(const std::string& name) {
  std::ifstream file(std::string(STEMVO_SOURCE_DIR) + "/tests/data/stems/" + name,
                     std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class OnnxApi : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(api, nullptr);
    ok(api->CreateEnv(ORT_LOGGING_LEVEL_FATAL, "test", &env));
    ok(api->CreateSessionOptions(&options));
    ok(api->SetSessionLogSeverityLevel(options, ORT_LOGGING_LEVEL_FATAL));
    ok(api->GetAllocatorWithDefaultOptions(&allocator));
    ASSERT_NE(allocator, nullptr);
  }
  void TearDown() override {
    if (session != nullptr) {
      api->ReleaseSession(session);
    }
    api->ReleaseSessionOptions(options);
    api->ReleaseEnv(env);
  }

  void ok(OrtStatus* status) const {
    if (status != nullptr) {
      ADD_FAILURE() << api->GetErrorMessage(status);
      api->ReleaseStatus(status);
    }
  }
  void load(const std::string& name) {
    const std::string model = read_model(name);
    ok(api->CreateSessionFromArray(env, model.data(), model.size(), options, &session));
    ASSERT_NE(session, nullptr);
  }
  std::string take(char* name) const {
    std::string copy = name;
    ok(api->AllocatorFree(allocator, name));
    return copy;
  }
  std::vector<std::int64_t> shape_of(const OrtTensorTypeAndShapeInfo* info) const {
    ONNXTensorElementDataType type = ONNX_TENSOR_ELEMENT_DATA_TYPE_UNDEFINED;
    ok(api->GetTensorElementType(info, &type));
    EXPECT_EQ(type, ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT);
    std::size_t rank = 0;
    ok(api->GetDimensionsCount(info, &rank));
    std::vector<std::int64_t> shape(rank);
    ok(api->GetDimensions(info, shape.data(), rank));
    return shape;
  }
  std::vector<std::int64_t> shape_and_release(OrtTypeInfo* type) const {
    ONNXType kind = ONNX_TYPE_UNKNOWN;
    ok(api->GetOnnxTypeFromTypeInfo(type, &kind));
    EXPECT_EQ(kind, ONNX_TYPE_TENSOR);
    const OrtTensorTypeAndShapeInfo* tensor = nullptr;
    ok(api->CastTypeInfoToTensorInfo(type, &tensor));
    std::vector<std::int64_t> shape = shape_of(tensor);
    api->ReleaseTypeInfo(type);
    return shape;
  }

  const OrtApi* api = OrtGetApiBase()->GetApi(5);
  OrtEnv* env = nullptr;
  OrtSessionOptions* options = nullptr;
  OrtAllocator* allocator = nullptr;
  OrtSession* session = nullptr;
};

TEST_F(OnnxApi, VersionIsKnownAndTheFutureIsNot) {
  EXPECT_THAT(OrtGetApiBase()->GetVersionString(), HasSubstr("."));
  EXPECT_EQ(OrtGetApiBase()->GetApi(100000), nullptr);
}

TEST_F(OnnxApi, ErrorsHaveAMessage) {
  OrtStatus* status = api->CreateSessionFromArray(env, "garbage", 7, options, &session);
  ASSERT_NE(status, nullptr);
  EXPECT_THAT(api->GetErrorMessage(status), HasSubstr("protobuf"));
  api->ReleaseStatus(status);
}

TEST_F(OnnxApi, SessionOptionsAreTaken) {
  ok(api->SetSessionExecutionMode(options, ORT_SEQUENTIAL));
  ok(api->SetIntraOpNumThreads(options, 1));
  ok(api->SetInterOpNumThreads(options, 1));
  ok(api->SetSessionGraphOptimizationLevel(options, ORT_ENABLE_ALL));
  ok(api->AddSessionConfigEntry(options, "session.use_env_allocators", "0"));
  load("plain_k4s4.onnx");
  // These two refuse nonsense, which shows that it is really them.
  OrtStatus* status =
      api->SetSessionGraphOptimizationLevel(options, static_cast<GraphOptimizationLevel>(50));
  EXPECT_NE(status, nullptr);
  api->ReleaseStatus(status);
  status = api->SetSessionExecutionMode(options, static_cast<ExecutionMode>(7));
  EXPECT_NE(status, nullptr);
  api->ReleaseStatus(status);
}

TEST_F(OnnxApi, NamesTypesAndShapes) {
  load("fixed_k4s4.onnx");
  std::size_t count = 0;
  ok(api->SessionGetInputCount(session, &count));
  EXPECT_EQ(count, 1U);
  ok(api->SessionGetOutputCount(session, &count));
  EXPECT_EQ(count, 1U);
  char* name = nullptr;
  ok(api->SessionGetInputName(session, 0, allocator, &name));
  EXPECT_EQ(take(name), "image");
  ok(api->SessionGetOutputName(session, 0, allocator, &name));
  EXPECT_EQ(take(name), "channels");
  OrtTypeInfo* type = nullptr;
  ok(api->SessionGetInputTypeInfo(session, 0, &type));
  EXPECT_THAT(shape_and_release(type), ElementsAre(1, 3, 32, 48));
  ok(api->SessionGetOutputTypeInfo(session, 0, &type));
  EXPECT_THAT(shape_and_release(type), ElementsAre(1, 3, 8, 12));
}

TEST_F(OnnxApi, MetadataIsFoundByItsKey) {
  load("plain_k4s4.onnx");
  OrtModelMetadata* metadata = nullptr;
  ok(api->SessionGetModelMetadata(session, &metadata));
  char* value = nullptr;
  ok(api->ModelMetadataLookupCustomMetadataMap(metadata, allocator, "stemvo.kernel", &value));
  ASSERT_NE(value, nullptr);
  EXPECT_EQ(take(value), "4 4");
  value = nullptr;
  ok(api->ModelMetadataLookupCustomMetadataMap(metadata, allocator, "none", &value));
  EXPECT_EQ(value, nullptr);
  api->ReleaseModelMetadata(metadata);
}

TEST_F(OnnxApi, RunOnOurOwnBuffers) {
  load("plain_k4s4.onnx");
  OrtMemoryInfo* memory = nullptr;
  ok(api->CreateCpuMemoryInfo(OrtDeviceAllocator, OrtMemTypeDefault, &memory));
  std::vector<float> image(3 * 4 * 8, 135.0F);  // 20 above the mean of the model's three means
  std::vector<float> channels(3 * 1 * 2, -1.0F);
  const std::array<std::int64_t, 4> in_shape = {1, 3, 4, 8};
  const std::array<std::int64_t, 4> out_shape = {1, 3, 1, 2};
  OrtValue* input = nullptr;
  OrtValue* output = nullptr;
  ok(api->CreateTensorWithDataAsOrtValue(memory, image.data(), image.size() * sizeof(float),
                                         in_shape.data(), in_shape.size(),
                                         ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &input));
  ok(api->CreateTensorWithDataAsOrtValue(memory, channels.data(), channels.size() * sizeof(float),
                                         out_shape.data(), out_shape.size(),
                                         ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &output));
  const char* const in_name = "image";
  const char* const out_name = "channels";
  const OrtValue* const inputs[] = {input};
  ok(api->Run(session, nullptr, &in_name, inputs, 1, &out_name, 1, &output));
  EXPECT_THAT(channels[0], FloatNear(20.0F, 1e-4F));
  EXPECT_THAT(channels[1], FloatNear(20.0F, 1e-4F));
  api->ReleaseValue(output);
  api->ReleaseValue(input);
  api->ReleaseMemoryInfo(memory);
}

}  // namespace
