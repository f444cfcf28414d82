// SPDX-License-Identifier: MIT
#include "stem/constant_sizes.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "stem/foreign_model.hpp"

namespace stemvo::internal {
namespace {

constexpr std::size_t kMaxRank = 64;

/// Of each value at most one.
constexpr std::array<std::string_view, 22> kCopying = {
    "Identity", "Cast",    "Reshape",    "Transpose", "Squeeze",    "Unsqueeze", "Flatten", "Slice",
    "Concat",   "Neg",     "Abs",        "Sqrt",      "Exp",        "Log",       "Floor",   "Ceil",
    "Relu",     "Sigmoid", "Reciprocal", "ReduceSum", "ReduceMean", "ReduceProd"};
/// Of each pair of values at most one.
constexpr std::array<std::string_view, 8> kPairing = {"Add", "Sub", "Mul", "Div",
                                                      "Pow", "Min", "Max", "Gather"};

template <std::size_t kSize>
bool is_among(std::string_view type, const std::array<std::string_view, kSize>& types) {
  return std::find(types.begin(), types.end(), type) != types.end();
}

}  // namespace

void ConstantSizes::add(std::string_view name, std::size_t num_values) {
  sizes_[name] = num_values;
}

void ConstantSizes::add_variable(std::string_view name) { sizes_.try_emplace(name, kVariable); }

Status ConstantSizes::add_node(std::string_view type,
                               const std::vector<std::string_view>& inputs,
                               const std::vector<std::string_view>& outputs) {
  std::size_t sum = 0;
  std::size_t product = 1;
  bool is_constant = true;
  for (const std::string_view input : inputs) {
    if (input.empty()) {  // left out
      continue;
    }
    const auto found = sizes_.find(input);
    if (found == sizes_.end()) {
      return fail(fmt::format("expected what an operator before it gives, found '{}'", input));
    }
    is_constant = is_constant && found->second != kVariable;
    // Both stay far below an overflow.
    const std::size_t size = std::min(found->second, std::size_t{kMaxProbeValues});
    sum += size;
    product = std::min(product * std::max<std::size_t>(size, 1), std::size_t{kMaxProbeValues} + 1);
  }
  std::size_t size = kVariable;
  if (type == "Shape" || type == "Size") {
    size = kMaxRank;
  } else if (is_constant) {
    const bool is_pairing = is_among(type, kPairing);
    if (!is_pairing && !is_among(type, kCopying)) {
      return fail(
          "expected it to depend on the image, found that ONNX Runtime would compute it, of any "
          "size, while it loads; compute it before the export");
    }
    size = is_pairing ? product : sum;
    num_computed_ += size;
    if (num_computed_ > kMaxProbeValues) {
      return fail(fmt::format("expected at most {} values that depend on no pixel, found more",
                              kMaxProbeValues));
    }
  }
  for (const std::string_view output : outputs) {
    sizes_[output] = size;
  }
  return {};
}

}  // namespace stemvo::internal
