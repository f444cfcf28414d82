// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace stemvo::internal {

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

}  // namespace stemvo::internal
