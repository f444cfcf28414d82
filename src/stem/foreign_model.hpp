// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

#include "stemvo/error.hpp"

namespace stemvo::internal {

/// Limits of a model, foreign code as it is. docs/security.md says them.
inline constexpr std::size_t kMaxModelBytes = std::size_t{512} << 20U;
/// Whole networks have hundreds. The time ONNX Runtime takes to load them grows by their square.
inline constexpr std::size_t kMaxNodes = 2000;
inline constexpr std::size_t kMaxLinks = 10000;  ///< inputs and outputs of nodes, weights
inline constexpr int kMaxKernel_px = 4096;       ///< of a manifest: through all layers below
inline constexpr int kMaxWindow_px = 256;  ///< of one operator: kernel, stride, padding, dilation
inline constexpr int kMaxStride_px = 256;
inline constexpr int kMaxFilters = 4096;
inline constexpr int kMaxPixels = 1 << 24;       ///< of an input of one size, and of a probe
inline constexpr int kMaxProbeValues = 1 << 27;  ///< of what a probe's outputs hold
inline constexpr int kMaxSecondsOfProbe = 10;    ///< for one small image

/// What can be told of the bytes of an .onnx before ONNX Runtime sees them. Error, starting with
/// `label`: no ONNX file; data in other files; operators that layers of images have none of; loops
/// and branches; kernels, strides, paddings and dilations over kMaxWindow_px; weights that are not
/// finite; constants that are computed while it is loaded and may be large.
[[nodiscard]] Status check_foreign_model(const std::string& label, std::string_view model);

}  // namespace stemvo::internal
