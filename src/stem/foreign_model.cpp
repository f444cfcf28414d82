// SPDX-License-Identifier: MIT
#include "stem/foreign_model.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "stem/constant_sizes.hpp"

namespace stemvo::internal {
namespace {

/// Walks the fields of a message in Protocol Buffers' wire format, which .onnx files have, without
/// asking for memory. Nothing is read beyond the bytes given.
class ProtobufReader {
 public:
  struct Field {
    std::uint64_t number = 0;
    std::uint64_t value = 0;  ///< of a number
    std::string_view bytes;  ///< of a text, a list or a message inside; of a fixed number its bytes
    bool is_bytes = false;
  };

  explicit ProtobufReader(std::string_view message) : rest_(message) {}

  /// Nullopt: the end, or not the wire format (is_damaged).
  [[nodiscard]] std::optional<Field> next() {
    if (rest_.empty() || is_damaged_) {
      return std::nullopt;
    }
    const std::uint64_t key = varint();
    Field field{key >> 3U, 0, {}, false};
    switch (key & 7U) {
      case 0:
        field.value = varint();
        break;
      case 1:
        field.bytes = take(8);
        break;
      case 2:
        field.is_bytes = true;
        field.bytes = take(varint());
        break;
      case 5:
        field.bytes = take(4);
        break;
      default:  // groups, which ONNX has none of
        is_damaged_ = true;
    }
    is_damaged_ = is_damaged_ || field.number == 0;
    return is_damaged_ ? std::nullopt : std::optional(field);
  }

  /// A list of numbers, "packed", one behind the other.
  [[nodiscard]] std::optional<std::uint64_t> next_packed() {
    if (rest_.empty() || is_damaged_) {
      return std::nullopt;
    }
    const std::uint64_t value = varint();
    return is_damaged_ ? std::nullopt : std::optional(value);
  }

  [[nodiscard]] bool is_damaged() const { return is_damaged_; }

 private:
  std::string_view take(std::uint64_t size) {
    if (size > rest_.size()) {
      is_damaged_ = true;
      return {};
    }
    const std::string_view taken = rest_.substr(0, static_cast<std::size_t>(size));
    rest_.remove_prefix(taken.size());
    return taken;
  }

  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64 && !rest_.empty(); shift += 7) {
      const auto byte = static_cast<unsigned char>(rest_.front());
      rest_.remove_prefix(1);
      value |= static_cast<std::uint64_t>(byte & 0x7fU) << shift;
      if ((byte & 0x80U) == 0) {
        return value;
      }
    }
    is_damaged_ = true;
    return 0;
  }

  std::string_view rest_;
  bool is_damaged_ = false;
};

using Field = ProtobufReader::Field;

// Numbers of onnx.proto.
enum ModelField : std::uint64_t { kModelGraph = 7, kModelFunctions = 25 };
enum GraphField : std::uint64_t {
  kGraphNode = 1,
  kGraphInitializer = 5,
  kGraphInput = 11,
  kGraphSparse = 15
};
enum ValueField : std::uint64_t { kValueName = 1 };
enum NodeField : std::uint64_t {
  kNodeInput = 1,
  kNodeOutput = 2,
  kNodeType = 4,
  kNodeAttribute = 5,
  kNodeDomain = 7
};
enum AttributeField : std::uint64_t {
  kAttributeName = 1,
  kAttributeInt = 3,
  kAttributeTensor = 5,
  kAttributeGraph = 6,
  kAttributeInts = 8,
  kAttributeTensors = 10,
  kAttributeGraphs = 11,
  kAttributeSparse = 22,
  kAttributeSparses = 23
};
enum TensorField : std::uint64_t {
  kTensorType = 2,
  kTensorFloats = 4,
  kTensorName = 8,
  kTensorRaw = 9,
  kTensorExternal = 13,
  kTensorLocation = 14
};
constexpr std::uint64_t kFloat32 = 1;  ///< a value of kTensorType

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
    name = field.number == kTensorName ? field.bytes : name;
    type = field.number == kTensorType ? field.value : type;
    raw = field.number == kTensorRaw ? field.bytes : raw;
    is_elsewhere = is_elsewhere || field.number == kTensorExternal ||
                   (field.number == kTensorLocation && field.value != 0);
    is_finite = is_finite && (field.number != kTensorFloats || all_finite(field.bytes));
    return {};
  });
  if (!status) {
    return status;
  }
  if (is_elsewhere) {
    return fail(fmt::format("expected all weights in the file, found '{}' in another", name));
  }
  static_assert(std::endian::native == std::endian::little, "as in the file");
  is_finite = is_finite && (type != kFloat32 || all_finite(raw));
  return is_finite || !is_weight
             ? Status()
             : Status(fail(
                   fmt::format("expected finite weights, found NaN or infinity in '{}'", name)));
}

bool is_size(std::string_view attribute) {
  constexpr std::array<std::string_view, 7> kSizes = {
      "kernel_shape", "strides", "pads", "dilations", "output_padding", "output_shape", "size"};
  return std::find(kSizes.begin(), kSizes.end(), attribute) != kSizes.end();
}

Status check_size(std::string_view name, std::uint64_t bits) {
  const auto size = static_cast<std::int64_t>(bits);
  return size >= -kMaxWindow_px && size <= kMaxWindow_px
             ? Status()
             : Status(fail(
                   fmt::format("expected {} of at most {}, found {}", name, kMaxWindow_px, size)));
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
    name = field.number == kAttributeName ? field.bytes : name;
    return {};
  });
  return !named ? named : for_each_field(message, [&](const Field& field) -> Status {
    switch (field.number) {
      case kAttributeGraph:
      case kAttributeGraphs:
        return fail("expected a graph without loops and branches, found one");
      case kAttributeSparse:
      case kAttributeSparses:
        return fail("expected dense constants, found sparse ones");
      case kAttributeTensor:
      case kAttributeTensors:
        return check_tensor(field.bytes, /*is_weight=*/false);
      case kAttributeInt:
      case kAttributeInts:
        return is_size(name) ? check_sizes(name, field) : Status();
      default:
        return {};
    }
  });
}

/// An upper bound, by the bytes it takes: the smallest kinds have two values in one.
std::size_t max_values(std::string_view tensor) { return 2 * tensor.size(); }

Status check_node(std::string_view message, ConstantSizes& constants) {
  std::string_view type;
  std::string_view domain;
  std::vector<std::string_view> inputs;
  std::vector<std::string_view> outputs;
  Status status = for_each_field(message, [&](const Field& field) -> Status {
    if (field.number == kNodeInput || field.number == kNodeOutput) {
      (field.number == kNodeInput ? inputs : outputs).push_back(field.bytes);
    }
    type = field.number == kNodeType ? field.bytes : type;
    domain = field.number == kNodeDomain ? field.bytes : domain;
    return {};
  });
  if (status && !domain.empty() && domain != "ai.onnx") {
    return fail(fmt::format("expected ONNX's own operators, found {} of '{}'", type, domain));
  }
  status = !status ? status : for_each_field(message, [&](const Field& field) -> Status {
    return field.number == kNodeAttribute ? check_attribute(field.bytes) : Status();
  });
  if (status && type == "Constant") {
    std::ranges::for_each(outputs,
                          [&](const auto& name) { constants.add(name, max_values(message)); });
  } else if (status) {
    status = constants.add_node(type, inputs, outputs);
  }
  return status ? status
                : Status(fail(fmt::format("operator {}: {}", type, status.error().message)));
}

/// What there is before the first node; it stands behind them in the file.
ConstantSizes constants_of(std::string_view graph) {
  ConstantSizes constants;
  std::vector<std::string_view> inputs;
  // Damage is found by who reads it next.
  static_cast<void>(for_each_field(graph, [&](const Field& field) -> Status {
    if (field.number != kGraphInitializer && field.number != kGraphInput) {
      return {};
    }
    const bool is_tensor = field.number == kGraphInitializer;
    std::string_view name;
    Status status = for_each_field(field.bytes, [&](const Field& one) -> Status {
      const std::uint64_t number_of_name = is_tensor ? std::uint64_t{kTensorName} : kValueName;
      name = one.number == number_of_name ? one.bytes : name;
      return {};
    });
    if (is_tensor) {
      constants.add(name, max_values(field.bytes));
    } else {
      inputs.push_back(name);
    }
    return status;
  }));
  std::ranges::for_each(inputs, [&](const auto& name) { constants.add_variable(name); });
  return constants;
}

/// Operators, and their inputs and outputs and the weights, which ONNX Runtime connects one by one.
/// Before anything is kept of them.
Status check_counts(std::string_view graph) {
  std::size_t num_nodes = 0;
  std::size_t num_links = 0;
  return for_each_field(graph, [&](const Field& field) -> Status {
    num_links += field.number == kGraphInitializer || field.number == kGraphInput ? 1 : 0;
    if (field.number == kGraphNode) {
      const Status read = for_each_field(field.bytes, [&](const Field& of_node) -> Status {
        num_links += of_node.number == kNodeInput || of_node.number == kNodeOutput ? 1 : 0;
        return {};
      });
      if (!read) {
        return read;
      }
      if (++num_nodes > kMaxNodes) {
        return fail(fmt::format("expected at most {} operators, found more", kMaxNodes));
      }
    }
    return num_links <= kMaxLinks
               ? Status()
               : Status(fail(fmt::format("expected at most {} inputs and outputs of operators and "
                                         "weights in all, found more",
                                         kMaxLinks)));
  });
}

Status check_graph(std::string_view message) {
  if (Status status = check_counts(message); !status) {
    return status;
  }
  ConstantSizes constants = constants_of(message);
  return for_each_field(message, [&](const Field& field) -> Status {
    switch (field.number) {
      case kGraphNode:
        return check_node(field.bytes, constants);
      case kGraphInitializer:
        return check_tensor(field.bytes, /*is_weight=*/true);
      case kGraphSparse:
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
  int num_graphs = 0;
  Status status;
  if (model.size() > kMaxModelBytes) {
    status = fail(fmt::format("expected at most {} bytes, found {}", kMaxModelBytes, model.size()));
  } else if (is_runtime_format(model)) {
    status = fail("expected an ONNX model, found one in ONNX Runtime's own format");
  } else {
    status = for_each_field(model, [&](const Field& field) -> Status {
      num_graphs += field.number == kModelGraph ? 1 : 0;
      return num_graphs > 1                    ? fail("expected one graph, found several")
             : field.number == kModelGraph     ? check_graph(field.bytes)
             : field.number == kModelFunctions ? fail("expected no functions, found one")
                                               : Status();
    });
    if (status && num_graphs == 0) {
      status = fail("expected an ONNX model, found a file without a graph");
    }
  }
  return status ? status : Status(fail(fmt::format("{}: {}", label, status.error().message)));
}

}  // namespace stemvo::internal
