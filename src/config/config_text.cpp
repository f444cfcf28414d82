// SPDX-License-Identifier: MIT
#include "config/config_text.hpp"

#include <charconv>
#include <system_error>
#include <type_traits>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

namespace stemvo::config {
namespace {

/// Whole text or nothing; a leading '+' is allowed as in YAML.
template <typename Number>
bool parse_decimal(std::string_view text, Number& value) {
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') {
    text.remove_prefix(1);
  }
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && stop == end;
}

std::string expected(std::string_view kind, std::string_view text) {
  return fmt::format("expected {}, found {}", kind, quote(text));
}

/// Shortest text that reads back to the same double, and reads as a number with a point.
std::string format_number(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_not_of("-0123456789") == std::string::npos) {
    text += ".0";
  }
  return text;
}

std::string format_text(const std::string& value) {
  const std::string plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_./-";
  const bool is_plain = value.find_first_not_of(plain) == std::string::npos;
  const bool is_word = !value.empty() && value.front() != '-';
  const bool is_null = YAML::IsNullString(value);
  YAML::Emitter out;
  if (is_plain && is_word && !is_null) {
    out << value;
  } else {
    out << YAML::DoubleQuoted << value;
  }
  return out.c_str();
}

std::string format_list(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) {
    text += (text.empty() ? "" : ", ") + format_number(value);
  }
  return "[" + text + "]";
}

}  // namespace

std::string quote(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  std::string shown(text.substr(0, kLongest));
  for (char& c : shown) {
    c = static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return "'" + shown + (text.size() > kLongest ? "...'" : "'");
}

std::string parse_number(std::string_view text, double& value) {
  return parse_decimal(text, value) ? std::string() : expected("a number", text);
}

std::string parse_scalar(const Field& field, std::string_view text) {
  return std::visit(
      [text](auto* value) -> std::string {
        using Value = std::remove_pointer_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, std::string>) {
          *value = text;
          return {};
        } else if constexpr (std::is_same_v<Value, bool>) {
          *value = text == "true";
          return text == "true" || text == "false" ? std::string()
                                                   : expected("true or false", text);
        } else if constexpr (std::is_same_v<Value, double>) {
          return parse_number(text, *value);
        } else if constexpr (std::is_same_v<Value, int>) {
          return parse_decimal(text, *value) ? std::string() : expected("a whole number", text);
        } else if constexpr (std::is_same_v<Value, std::uint64_t>) {
          return parse_decimal(text, *value) ? std::string()
                                             : expected("a whole number of at least 0", text);
        } else {
          return expected("a list of numbers like [100, 200]", text);
        }
      },
      field.value);
}

std::string format_value(const Field& field) {
  return std::visit(
      [](const auto* value) -> std::string {
        using Value = std::remove_cv_t<std::remove_pointer_t<decltype(value)>>;
        if constexpr (std::is_same_v<Value, std::string>) {
          return format_text(*value);
        } else if constexpr (std::is_same_v<Value, double>) {
          return format_number(*value);
        } else if constexpr (std::is_same_v<Value, std::vector<double>>) {
          return format_list(*value);
        } else {
          return fmt::format("{}", *value);
        }
      },
      field.value);
}

}  // namespace stemvo::config
