// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo {

/// Error: one of the `outputs` is one of the `inputs`, also through a link; writing would destroy
/// what was given. What is not there is nothing.
[[nodiscard]] Status check_spares_inputs(const std::vector<std::filesystem::path>& outputs,
                                         const std::vector<std::filesystem::path>& inputs);

}  // namespace stemvo
