// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

namespace stemvo::apps {

/// "models" or "config": <prefix>/share/stemvo/NAME of the prefix that the program is installed
/// under, else NAME in the source tree it was built from.
[[nodiscard]] std::filesystem::path data_folder(const char* name);

}  // namespace stemvo::apps
