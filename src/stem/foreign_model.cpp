// SPDX-License-Identifier: MIT
#include "stem/foreign_model.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "stem/protobuf_reader.hpp"

namespace stemvo::internal {
namespace {

using Field = ProtobufReader::Field;

/// Numbers of onnx.proto.
namespace number {
namespace model {
constexpr std::uint64_t kGraph = 7;
constexpr std::uint64_t kFunctions = 25;
}  // namespace model
namespace graph {
constexpr std::uint64_t kNode = 1;
constexpr std::uint64_t kInitializer = 5;
constexpr std::uint64_t kSparseInitializer = 15;
}  // namespace graph
namespace node {
constexpr std::uint64_t kType = 4;
constexpr std::uint64_t kAttribute = 5;
constexpr std::uint64_t kDomain = 7;
}  // namespace node
namespace attribute {
constexpr std::uint64_t kName = 1;
constexpr std::uint64_t kTensor = 5;
constexpr std::uint64_t kGraph = 6;
constexpr std::uint64_t kInts = 8;
constexpr std::uint64_t kTensors = 10;
constexpr std::uint64_t kGraphs = 11;
}  // namespace attribute
namespace tensor {
constexpr std::uint64_t kType = 2;
constexpr std::uint64_t kFloats = 4;
constexpr std::uint64_t kName = 8;
constexpr std::uint64_t kRaw = 9;
constexpr std::uint64_t kExternal = 13;
constexpr std::uint64_t kLocation = 14;
constexpr std::uint64_t kFloat32 = 1;  ///< a value of kType
}  // namespace tensor
}  // namespace number

/// Calls `visit` for each field until it returns an Error.
template <typename Visit>
Status for_each_field(std::string_view message, const Visit& visit) {
  ProtobufReader reader(message);
  while (const auto field = reader.next()) {
    if (Status status = visit(*field); !status) {
      return status;
    }
  }
  return reader.is_damaged() ? Status(fail("expected an ONNX model, found a damaged file or none"))
                             : Status();
}

bool all_finite(std::string_view floats) {
  for (std::size_t i = 0; i + sizeof(float) <= floats.size(); i += sizeof(float)) {
    float value = 0.0F;
    std::memcpy(&value, floats.data() + i, sizeof(float));
    if (!std::isfinite(value)) {
      return false;
    }
  }
  return true;
}

Status check_tensor(std::string_view message, bool is_weight) {
  std::string_view name = "a constant";
  std::uint64_t type = 0;
  bool is_elsewhere = false;
  bool is_finite = true;
  std::string_view raw;
  const Status status = for_each_field(message, [&](const Field& field) -> Status {
    name = field.number == number::tensor::kName ? field.bytes : name;
    type = field.number == number::tensor::kType ? field.value : type;
    raw = field.number == number::tensor::kRaw ? field.bytes : raw;
    is_elsewhere = is_elsewhere || field.number == number::tensor::kExternal ||
                   (field.number == number::tensor::kLocation && field.value != 0);
    is_finite = is_finite && (field.number != number::tensor::kFloats || all_finite(field.bytes));
    return {};
  });
  if (!status) {
    return status;
  }
  if (is_elsewhere) {
    return fail(fmt::format("expected all weights in the file, found '{}' in another", name));
  }
  static_assert(std::endian::native == std::endian::little, "as in the file");
  is_finite = is_finite && (type != number::tensor::kFloat32 || all_finite(raw));
  return is_finite || !is_weight
             ? Status()
             : Status(fail(
                   fmt::format("expected finite weights, found NaN or infinity in '{}'", name)));
}

bool is_size(std::string_view attribute) {
  constexpr std::array<std::string_view, 6> kSizes = {
      "kernel_shape", "strides", "pads", "dilations", "output_padding", "output_shape"};
  return std::find(kSizes.begin(), kSizes.end(), attribute) != kSizes.end();
}

Status check_size(std::string_view name, std::uint64_t bits) {
  const auto size = static_cast<std::int64_t>(bits);
  return size >= -kMaxKernel_px && size <= kMaxKernel_px
             ? Status()
             : Status(fail(
                   fmt::format("expected {} of at most {}, found {}", name, kMaxKernel_px, size)));
}

/// One number, or a packed list.
Status check_sizes(std::string_view name, const Field& field) {
  if (!field.is_bytes) {
    return check_size(name, field.value);
  }
  ProtobufReader list(field.bytes);
  while (const auto bits = list.next_packed()) {
    if (Status status = check_size(name, *bits); !status) {
      return status;
    }
  }
  return {};
}

Status check_attribute(std::string_view message) {
  std::string_view name;
  const Status named = for_each_field(message, [&](const Field& field) -> Status {
    name = field.number == number::attribute::kName ? field.bytes : name;
    return {};
  });
  return !named ? named : for_each_field(message, [&](const Field& field) -> Status {
    switch (field.number) {
      case number::attribute::kGraph:
      case number::attribute::kGraphs:
        return fail("expected a graph without loops and branches, found one");
      case number::attribute::kTensor:
      case number::attribute::kTensors:
        return check_tensor(field.bytes, /*is_weight=*/false);
      case number::attribute::kInts:
        return is_size(name) ? check_sizes(name, field) : Status();
      default:
        return {};
    }
  });
}

Status check_node(std::string_view message) {
  std::string_view type;
  std::string_view domain;
  Status status = for_each_field(message, [&](const Field& field) -> Status {
    type = field.number == number::node::kType ? field.bytes : type;
    domain = field.number == number::node::kDomain ? field.bytes : domain;
    return {};
  });
  if (status && !domain.empty() && domain != "ai.onnx") {
    return fail(fmt::format("expected ONNX's own operators, found {} of '{}'", type, domain));
  }
  status = !status ? status : for_each_field(message, [&](const Field& field) -> Status {
    return field.number == number::node::kAttribute ? check_attribute(field.bytes) : Status();
  });
  return status ? status
                : Status(fail(fmt::format("operator {}: {}", type, status.error().message)));
}

Status check_graph(std::string_view message) {
  return for_each_field(message, [](const Field& field) -> Status {
    switch (field.number) {
      case number::graph::kNode:
        return check_node(field.bytes);
      case number::graph::kInitializer:
        return check_tensor(field.bytes, /*is_weight=*/true);
      case number::graph::kSparseInitializer:
        return fail("expected dense weights, found sparse ones");
      default:
        return {};
    }
  });
}

/// ONNX Runtime takes a format of its own too, told by these bytes.
bool is_runtime_format(std::string_view model) {
  return model.size() >= 8 && model.substr(4, 4) == "ORTM";
}

}  // namespace

Status check_foreign_model(const std::string& label, std::string_view model) {
  bool has_graph = false;
  Status status;
  if (model.size() > kMaxModelBytes) {
    status = fail(fmt::format("expected at most {} bytes, found {}", kMaxModelBytes, model.size()));
  } else if (is_runtime_format(model)) {
    status = fail("expected an ONNX model, found one in ONNX Runtime's own format");
  } else {
    status = for_each_field(model, [&](const Field& field) -> Status {
      has_graph = has_graph || field.number == number::model::kGraph;
      return field.number == number::model::kGraph       ? check_graph(field.bytes)
             : field.number == number::model::kFunctions ? fail("expected no functions, found one")
                                                         : Status();
    });
    if (status && !has_graph) {
      status = fail("expected an ONNX model, found a file without a graph");
    }
  }
  return status ? status : Status(fail(fmt::format("{}: {}", label, status.error().message)));
}

}  // namespace stemvo::internal
