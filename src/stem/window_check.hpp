// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "stem/onnx_session.hpp"
#include "stem/sampling.hpp"
#include "stemvo/error.hpp"

namespace stemvo::internal {

/// Holds the graph against the stride and the sizes of channels that its manifest entry says; all
/// that can be asked of a layer that is padded inside or sees the whole frame. `label` starts the
/// message.
[[nodiscard]] Status check_sizes(const std::string& label,
                                 const OnnxSession& session,
                                 const SamplingPlan& native);

/// Holds the graph against kernel, stride and padding of its manifest entry (`native`: the plan at
/// the stride itself): the size of its channels, and that an output depends on the pixels of its
/// window and on no others. So the pixel map is right, and passes over a shifted frame agree (a
/// graph that normalises over the whole picture, say, is refused). `label` starts the message.
[[nodiscard]] Status check_window(const std::string& label,
                                  const OnnxSession& session,
                                  const SamplingPlan& native);

}  // namespace stemvo::internal
