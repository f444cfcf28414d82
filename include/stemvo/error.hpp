// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

namespace stemvo {

/// The world disagrees: a file, a model, an option, a frame. The message is one line that names
/// what was looked at (file and line where there is one), what was expected and what was found.
struct Error {
  std::string message;
};

/// `return fail("calib.txt:3: expected ...")` from any function that returns Expected.
[[nodiscard]] inline Error fail(std::string message) { return {std::move(message)}; }

/// A value, or the Error that kept us from it (C++23's std::expected, as far as it is used here).
/// value(), * and -> of an error throw std::runtime_error with its message; error() of a value
/// throws std::bad_variant_access.
/// An error is passed on by `return other.error();`.
template <typename T>
class [[nodiscard]] Expected {
  using Value = std::conditional_t<std::is_void_v<T>, std::monostate, T>;

  std::variant<Value, Error> result_;

  void require() const {
    if (!has_value()) {
      throw std::runtime_error(error().message);
    }
  }
  template <typename F>
  auto call(F& f) const {
    if constexpr (std::is_void_v<T>) {
      return f();
    } else {
      return std::invoke(f, std::get<0>(result_));
    }
  }

 public:
  Expected()
    requires std::is_default_constructible_v<Value>
      : result_(std::in_place_index<0>) {}
  template <typename U = Value>
    requires(std::is_convertible_v<U&&, Value> && !std::is_void_v<T> &&
             !std::is_same_v<std::remove_cvref_t<U>, Expected> &&
             !std::is_same_v<std::remove_cvref_t<U>, Error>)
  Expected(U&& value) : result_(std::in_place_index<0>, std::forward<U>(value)) {}
  Expected(Error error) : result_(std::in_place_index<1>, std::move(error)) {}

  [[nodiscard]] bool has_value() const { return result_.index() == 0; }
  explicit operator bool() const { return has_value(); }

  [[nodiscard]] Value& value() & { return require(), std::get<0>(result_); }
  [[nodiscard]] const Value& value() const& { return require(), std::get<0>(result_); }
  [[nodiscard]] Value&& value() && { return require(), std::get<0>(std::move(result_)); }
  [[nodiscard]] Value& operator*() & { return value(); }
  [[nodiscard]] const Value& operator*() const& { return value(); }
  [[nodiscard]] Value&& operator*() && { return std::move(*this).value(); }
  [[nodiscard]] Value* operator->() { return &value(); }
  [[nodiscard]] const Value* operator->() const { return &value(); }
  template <typename U>
  [[nodiscard]] Value value_or(U&& other) const {
    return has_value() ? value() : static_cast<Value>(std::forward<U>(other));
  }
  [[nodiscard]] const Error& error() const { return std::get<1>(result_); }

  /// Hands the value (nothing, if T is void) to `f`, which can fail itself; an error
  /// stays.
  template <typename F>
  [[nodiscard]] auto and_then(F&& f) const {
    using Result = decltype(call(f));
    return has_value() ? call(f) : Result(error());
  }
  /// The same for an `f` that cannot fail.
  template <typename F>
  [[nodiscard]] auto map(F&& f) const {
    using Result = Expected<decltype(call(f))>;
    return has_value() ? Result(call(f)) : Result(error());
  }
};

/// Success, or an Error.
using Status = Expected<void>;

}  // namespace stemvo
