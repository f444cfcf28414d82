// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include "stemvo/error.hpp"

namespace stemvo::pipeline {

[[nodiscard]] Status create_out_folder(const std::filesystem::path& folder);

/// Whether this command ("run", ..) made the folder: the mark in it, the file .stemvo, says so.
[[nodiscard]] bool is_folder_of(const std::filesystem::path& folder, const std::string& command);

/// Creates results/NAME, or results/NAME_2, _3 .. where that is taken.
[[nodiscard]] Expected<std::filesystem::path> create_results_folder(const std::string& name);

/// Creates the folder with the command's mark. Errors: it holds files but no mark of this command;
/// it cannot be written.
[[nodiscard]] Status open_out_folder(const std::filesystem::path& folder,
                                     const std::string& command);

}  // namespace stemvo::pipeline
