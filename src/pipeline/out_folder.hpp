// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// Creates the folder (and those above it) and proves that files can be written there. Error: the
/// folder, what was expected, what the system says.
[[nodiscard]] Status create_out_folder(const std::filesystem::path& folder);

/// Removes the images an earlier run left in its folder, so that those of one run are not taken
/// for another's: files of six digits and `.png`, nothing else. Error: one that cannot be removed.
[[nodiscard]] Status remove_old_images(const std::filesystem::path& folder);

}  // namespace stemvo::pipeline
