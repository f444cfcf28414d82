// SPDX-License-Identifier: MIT
#pragma once

// The part of ONNX Runtime's C interface that stemvo calls, for systems without the official
// header (the PyPI wheel, where the library comes from, holds none). Names, types and numbers are
// those of the official header, so that either one can be included. The functions stand in a table
// that only ever grows at its end: what is listed here belongs to version 5 of it, and the unused
// places between are padding.

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct OrtStatus OrtStatus;
typedef struct OrtEnv OrtEnv;
typedef struct OrtMemoryInfo OrtMemoryInfo;
typedef struct OrtSession OrtSession;
typedef struct OrtValue OrtValue;
typedef struct OrtRunOptions OrtRunOptions;
typedef struct OrtModelMetadata OrtModelMetadata;
typedef struct OrtTypeInfo OrtTypeInfo;
typedef struct OrtTensorTypeAndShapeInfo OrtTensorTypeAndShapeInfo;
typedef struct OrtSessionOptions OrtSessionOptions;
typedef struct OrtAllocator OrtAllocator;

// A null pointer is success.
typedef OrtStatus* OrtStatusPtr;

typedef enum OrtLoggingLevel {
  ORT_LOGGING_LEVEL_VERBOSE = 0,
  ORT_LOGGING_LEVEL_INFO = 1,
  ORT_LOGGING_LEVEL_WARNING = 2,
  ORT_LOGGING_LEVEL_ERROR = 3,
  ORT_LOGGING_LEVEL_FATAL = 4
} OrtLoggingLevel;

typedef enum ExecutionMode { ORT_SEQUENTIAL = 0, ORT_PARALLEL = 1 } ExecutionMode;

typedef enum GraphOptimizationLevel {
  ORT_DISABLE_ALL = 0,
  ORT_ENABLE_BASIC = 1,
  ORT_ENABLE_EXTENDED = 2,
  ORT_ENABLE_ALL = 99
} GraphOptimizationLevel;

typedef enum OrtAllocatorType {
  OrtInvalidAllocator = -1,
  OrtDeviceAllocator = 0,
  OrtArenaAllocator = 1
} OrtAllocatorType;

typedef enum OrtMemType {
  OrtMemTypeCPUInput = -2,
  OrtMemTypeCPUOutput = -1,
  OrtMemTypeDefault = 0
} OrtMemType;

typedef enum ONNXType { ONNX_TYPE_UNKNOWN = 0, ONNX_TYPE_TENSOR = 1 } ONNXType;

typedef enum ONNXTensorElementDataType {
  ONNX_TENSOR_ELEMENT_DATA_TYPE_UNDEFINED = 0,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT = 1,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_UINT8 = 2,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_INT8 = 3,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_UINT16 = 4,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_INT16 = 5,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_INT32 = 6,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_INT64 = 7,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_STRING = 8,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_BOOL = 9,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT16 = 10,
  ONNX_TENSOR_ELEMENT_DATA_TYPE_DOUBLE = 11
} ONNXTensorElementDataType;

// Place N of the table is the N-th pointer; `unused_A_B` pads places A to B.
typedef struct OrtApi {
  void* unused_0_1[2];
  const char* (*GetErrorMessage)(const OrtStatus* status);
  OrtStatusPtr (*CreateEnv)(OrtLoggingLevel level, const char* log_id, OrtEnv** out);
  void* unused_4_7[4];
  OrtStatusPtr (*CreateSessionFromArray)(const OrtEnv* env,
                                         const void* model,
                                         size_t model_bytes,
                                         const OrtSessionOptions* options,
                                         OrtSession** out);
  OrtStatusPtr (*Run)(OrtSession* session,
                      const OrtRunOptions* options,
                      const char* const* input_names,
                      const OrtValue* const* inputs,
                      size_t input_count,
                      const char* const* output_names,
                      size_t output_count,
                      OrtValue** outputs);
  OrtStatusPtr (*CreateSessionOptions)(OrtSessionOptions** out);
  void* unused_11_12[2];
  OrtStatusPtr (*SetSessionExecutionMode)(OrtSessionOptions* options, ExecutionMode mode);
  void* unused_14_21[8];
  OrtStatusPtr (*SetSessionLogSeverityLevel)(OrtSessionOptions* options, int level);
  OrtStatusPtr (*SetSessionGraphOptimizationLevel)(OrtSessionOptions* options,
                                                   GraphOptimizationLevel level);
  OrtStatusPtr (*SetIntraOpNumThreads)(OrtSessionOptions* options, int threads);
  OrtStatusPtr (*SetInterOpNumThreads)(OrtSessionOptions* options, int threads);
  void* unused_26_29[4];
  OrtStatusPtr (*SessionGetInputCount)(const OrtSession* session, size_t* out);
  OrtStatusPtr (*SessionGetOutputCount)(const OrtSession* session, size_t* out);
  void* unused_32;
  OrtStatusPtr (*SessionGetInputTypeInfo)(const OrtSession* session,
                                          size_t index,
                                          OrtTypeInfo** out);
  OrtStatusPtr (*SessionGetOutputTypeInfo)(const OrtSession* session,
                                           size_t index,
                                           OrtTypeInfo** out);
  void* unused_35;
  OrtStatusPtr (*SessionGetInputName)(const OrtSession* session,
                                      size_t index,
                                      OrtAllocator* allocator,
                                      char** out);
  OrtStatusPtr (*SessionGetOutputName)(const OrtSession* session,
                                       size_t index,
                                       OrtAllocator* allocator,
                                       char** out);
  void* unused_38_48[11];
  OrtStatusPtr (*CreateTensorWithDataAsOrtValue)(const OrtMemoryInfo* memory,
                                                 void* data,
                                                 size_t data_bytes,
                                                 const int64_t* shape,
                                                 size_t rank,
                                                 ONNXTensorElementDataType type,
                                                 OrtValue** out);
  void* unused_50_54[5];
  OrtStatusPtr (*CastTypeInfoToTensorInfo)(const OrtTypeInfo* info,
                                           const OrtTensorTypeAndShapeInfo** out);
  OrtStatusPtr (*GetOnnxTypeFromTypeInfo)(const OrtTypeInfo* info, ONNXType* out);
  void* unused_57_59[3];
  OrtStatusPtr (*GetTensorElementType)(const OrtTensorTypeAndShapeInfo* info,
                                       ONNXTensorElementDataType* out);
  OrtStatusPtr (*GetDimensionsCount)(const OrtTensorTypeAndShapeInfo* info, size_t* out);
  OrtStatusPtr (*GetDimensions)(const OrtTensorTypeAndShapeInfo* info,
                                int64_t* dimensions,
                                size_t rank);
  void* unused_63_68[6];
  OrtStatusPtr (*CreateCpuMemoryInfo)(OrtAllocatorType type,
                                      OrtMemType mem_type,
                                      OrtMemoryInfo** out);
  void* unused_70_75[6];
  OrtStatusPtr (*AllocatorFree)(OrtAllocator* allocator, void* pointer);
  void* unused_77;
  OrtStatusPtr (*GetAllocatorWithDefaultOptions)(OrtAllocator** out);
  void* unused_79_91[13];
  void (*ReleaseEnv)(OrtEnv* env);
  void (*ReleaseStatus)(OrtStatus* status);
  void (*ReleaseMemoryInfo)(OrtMemoryInfo* memory);
  void (*ReleaseSession)(OrtSession* session);
  void (*ReleaseValue)(OrtValue* value);
  void* unused_97;
  void (*ReleaseTypeInfo)(OrtTypeInfo* info);
  void* unused_99;
  void (*ReleaseSessionOptions)(OrtSessionOptions* options);
  void* unused_101_110[10];
  OrtStatusPtr (*SessionGetModelMetadata)(const OrtSession* session, OrtModelMetadata** out);
  void* unused_112_115[4];
  OrtStatusPtr (*ModelMetadataLookupCustomMetadataMap)(const OrtModelMetadata* metadata,
                                                       OrtAllocator* allocator,
                                                       const char* key,
                                                       char** out);
  void* unused_117;
  void (*ReleaseModelMetadata)(OrtModelMetadata* metadata);
  void* unused_119_129[11];
  OrtStatusPtr (*AddSessionConfigEntry)(OrtSessionOptions* options,
                                        const char* key,
                                        const char* value);
} OrtApi;

typedef struct OrtApiBase {
  // Null if the library is older than `version`.
  const OrtApi* (*GetApi)(uint32_t version);
  const char* (*GetVersionString)(void);
} OrtApiBase;

const OrtApiBase* OrtGetApiBase(void);

#ifdef __cplusplus
}  // extern "C"

static_assert(offsetof(OrtApi, Run) == 9 * sizeof(void*), "place in the table");
static_assert(offsetof(OrtApi, SessionGetInputCount) == 30 * sizeof(void*), "place in the table");
static_assert(offsetof(OrtApi, CreateCpuMemoryInfo) == 69 * sizeof(void*), "place in the table");
static_assert(offsetof(OrtApi, ReleaseSessionOptions) == 100 * sizeof(void*), "place in the table");
static_assert(offsetof(OrtApi, ReleaseModelMetadata) == 118 * sizeof(void*), "place in the table");
static_assert(offsetof(OrtApi, AddSessionConfigEntry) == 130 * sizeof(void*), "place in the table");
#endif
