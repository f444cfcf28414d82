// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "stemvo/options.hpp"

namespace stemvo::options {

/// Which values a key may have. Bounds hold for every element of a list; infinite and NaN never
/// pass.
struct Rule {
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double min = -kInfinity;
  double max = kInfinity;
  bool odd = false;
  std::vector<std::string_view> choices;  ///< of a text (empty: any but none) or enumerators

  static Rule between(double min, double max) { return {min, max, false, {}}; }
  static Rule odd_between(double min, double max) { return {min, max, true, {}}; }
  static Rule one_of(std::vector<std::string_view> choices) {
    return {-kInfinity, kInfinity, false, std::move(choices)};
  }
};

/// An enumerator by its number, which is also that of its name among Rule::choices.
struct EnumValue {
  void* target = nullptr;
  int (*get)(const void*) = nullptr;
  void (*set)(void*, int) = nullptr;
};
template <typename Enum>
EnumValue enum_value(Enum* target) {
  return {target,
          [](const void* from) { return static_cast<int>(*static_cast<const Enum*>(from)); },
          [](void* to, int number) { *static_cast<Enum*>(to) = static_cast<Enum>(number); }};
}

using FieldValue = std::
    variant<std::string*, int*, double*, bool*, std::uint64_t*, std::vector<double>*, EnumValue>;

/// One function for std::visit of several, one per type of a FieldValue.
template <typename... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <typename... Functions>  // clang 16 does not deduce it
Overloaded(Functions...) -> Overloaded<Functions...>;

/// One key: everything that reading, writing, checking and explaining it needs.
struct Field {
  std::string_view section;  ///< empty for the keys of the top level
  std::string_view key;
  FieldValue value;  ///< points into the options given to fields_of()
  Rule rule;
  std::string_view help;
  bool is_given = false;  ///< a document that was read names it

  [[nodiscard]] std::string name() const {
    return section.empty() ? std::string(key) : std::string(section) + "." + std::string(key);
  }
};

inline constexpr std::array<std::string_view, 4> kScaleSources{"none", "constant_speed",
                                                               "camera_height", "ground_truth"};
[[nodiscard]] inline std::string_view to_string(ScaleSource source) {
  return kScaleSources.at(static_cast<std::size_t>(source));
}

inline constexpr std::array<std::string_view, 4> kFeatureMethods{"patch", "klt", "orb", "sift"};
[[nodiscard]] inline std::string_view to_string(FeatureMethod method) {
  return kFeatureMethods.at(static_cast<std::size_t>(method));
}

/// Of the name; of another one no enumerator, which validate() refuses.
[[nodiscard]] inline FeatureMethod feature_method(std::string_view name) {
  const auto* const found = std::find(kFeatureMethods.begin(), kFeatureMethods.end(), name);
  return static_cast<FeatureMethod>(found - kFeatureMethods.begin());
}

/// The table of all keys, in the order in which they are written.
[[nodiscard]] std::vector<Field> fields_of(Options& options);

/// 'text' on one line, cut when long, for messages.
[[nodiscard]] std::string quote(std::string_view text);
/// "expected one of ..., found 'text'".
[[nodiscard]] std::string not_a_choice(const Rule& rule, std::string_view text);
/// Nothing, or what the rule expected and what the value is: "expected ..., found ...".
[[nodiscard]] std::string violation_of(const Field& field);
/// The first violation, with its key in front.
[[nodiscard]] Status check(const std::vector<Field>& fields);

}  // namespace stemvo::options
