// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo::internal {

/// How many values the constants of a graph have at most. ONNX Runtime computes, while it loads,
/// whatever depends on no pixel: within no limit of time or memory but this one.
class ConstantSizes {
 public:
  /// A weight, or what a node holds as one.
  void add(std::string_view name, std::size_t num_values);
  /// The next node. Error: of a kind that layers of images have none of; one that depends on
  /// constants alone (the shape of an image counts as one), and makes more of them than can be told
  /// beforehand, or too many; what it takes comes from no node before it.
  [[nodiscard]] Status add_node(std::string_view type,
                                const std::vector<std::string_view>& inputs,
                                const std::vector<std::string_view>& outputs);
  /// The graph's own input, or another value that depends on it.
  void add_variable(std::string_view name);

 private:
  static constexpr std::size_t kVariable = SIZE_MAX;

  std::unordered_map<std::string_view, std::size_t> sizes_;
  std::size_t num_computed_ = 0;
};

}  // namespace stemvo::internal
