// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "stem/model.hpp"
#include "stemvo/error.hpp"

namespace stemvo::internal {

/// Runs the graph on small images and holds its outputs against kernel, stride and padding; see
/// open_model. `label` is what messages call the file.
[[nodiscard]] Status check_graph(const std::string& label,
                                 const OnnxSession& session,
                                 const ModelInfo& info);

}  // namespace stemvo::internal
