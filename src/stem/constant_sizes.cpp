// SPDX-License-Identifier: MIT
#include "stem/constant_sizes.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "stem/foreign_model.hpp"
#include "text/text_file.hpp"

namespace stemvo::internal {
namespace {

constexpr std::size_t kMaxRank = 64;

/// Of each value at most one.
constexpr std::string_view kCopying =
    "Identity Cast Reshape Transpose Squeeze Unsqueeze Flatten Slice Concat Neg Abs Sqrt Exp Log "
    "Floor Ceil Relu Sigmoid Reciprocal ReduceSum ReduceMean ReduceProd";
/// Of each pair of values at most one.
constexpr std::string_view kPairing = "Add Sub Mul Div Pow Min Max Gather";
/// Whatever else layers of image networks consist of. None takes a count or a place from an
/// attribute or a pixel; sizes of windows have their limit (kMaxWindow_px).
constexpr std::string_view kOfImages =
    "Conv ConvTranspose MaxPool AveragePool GlobalAveragePool GlobalMaxPool BatchNormalization "
    "InstanceNormalization GroupNormalization LayerNormalization RMSNormalization LpNormalization "
    "LRN PRelu LeakyRelu ThresholdedRelu Elu Celu Selu Gelu Mish Swish HardSigmoid HardSwish "
    "Softplus Softsign Softmax LogSoftmax Tanh Erf Sign Round Clip Dropout Sum Mean Where Equal "
    "Greater Less And Or Not MatMul Gemm ReduceMax ReduceMin ReduceL1 ReduceL2 ReduceSumSquare "
    "Split Pad Resize DepthToSpace SpaceToDepth";

bool is_among(std::string_view type, std::string_view types) {
  for (auto word = take_word(types); !word.empty(); word = take_word(types)) {
    if (word == type) {
      return true;
    }
  }
  return false;
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
  const bool is_pairing = is_among(type, kPairing);
  const bool is_copying = is_among(type, kCopying);
  if (type == "Shape" || type == "Size") {
    size = kMaxRank;
  } else if (!is_pairing && !is_copying && !is_among(type, kOfImages)) {
    return fail(
        "expected an operator that layers of image networks consist of, found another one; cut the "
        "model before it (tools/export_stem.py --layers)");
  } else if (is_constant) {
    if (!is_pairing && !is_copying) {
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
