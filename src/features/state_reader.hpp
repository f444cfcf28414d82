// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <type_traits>

#include <cereal/archives/binary.hpp>

namespace stemvo {

/// Reads what a StateWriter wrote. The bytes are input: it throws std::runtime_error where they
/// end too soon, or say what no writer does, before memory is asked for.
class StateReader : public cereal::InputArchive<StateReader, cereal::AllowEmptyClassElision> {
 public:
  explicit StateReader(std::string_view bytes) : InputArchive(this), rest_(bytes) {}

  void take(void* to, std::size_t num_bytes) {
    expect(num_bytes <= rest_.size());
    if (num_bytes > 0) {
      std::memcpy(to, rest_.data(), num_bytes);
      rest_.remove_prefix(num_bytes);
    }
  }
  [[nodiscard]] std::size_t num_left() const { return rest_.size(); }

  static void expect(bool is_sound) {
    if (!is_sound) {
      throw cereal::Exception("expected a state, found other bytes");
    }
  }
  /// In what reads and writes alike: of what was read.
  template <typename Archive>
  static void expect_of(bool is_sound) {
    expect(is_sound || !std::is_same_v<Archive, StateReader>);
  }

 private:
  std::string_view rest_;
};

template <typename T>
  requires(std::is_arithmetic_v<T>)
void load(StateReader& reader, T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    std::uint8_t byte = 0;
    reader.take(&byte, 1);
    StateReader::expect(byte <= 1);
    value = byte != 0;
  } else {
    reader.take(&value, sizeof(T));
  }
}
template <typename T>
void load(StateReader& reader, cereal::BinaryData<T>& data) {
  reader.take(data.data, static_cast<std::size_t>(data.size));
}
template <typename T>
void serialize(StateReader& reader, cereal::NameValuePair<T>& pair) {
  reader(pair.value);
}
/// Each element has a byte at least.
template <typename T>
void serialize(StateReader& reader, cereal::SizeTag<T>& count) {
  reader(count.size);
  StateReader::expect(count.size <= reader.num_left());
}

}  // namespace stemvo

template <>
struct cereal::traits::detail::get_output_from_input<stemvo::StateReader> {
  using type = cereal::BinaryOutputArchive;
};
