// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// Creates the folder (and those above it) and proves that files can be written there. Error: the
/// folder, what was expected, what the system says.
[[nodiscard]] Status create_out_folder(const std::filesystem::path& folder);

/// Removes what an earlier run left in its folder, so that images of one run are not taken for
/// another's: files of six digits and the extension, nothing else; no folder is none. Error: one
/// that cannot be removed.
[[nodiscard]] Status remove_old_frames(const std::filesystem::path& folder,
                                       const std::string& extension);

}  // namespace stemvo::pipeline
