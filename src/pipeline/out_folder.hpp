// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// An advisory lock of a folder: the kernel lets go of it however the process ends.
using FolderLock = std::shared_ptr<void>;

[[nodiscard]] Status create_out_folder(const std::filesystem::path& folder);

/// Whether this command ("run", ..) made the folder: the mark in it, the file .stemvo, says so.
[[nodiscard]] bool is_folder_of(const std::filesystem::path& folder, const std::string& command);

/// Creates results/NAME, or results/NAME_2, _3 .. where that is taken.
[[nodiscard]] Expected<std::filesystem::path> create_results_folder(const std::string& name);

/// Creates the folder with the command's mark and locks it. Errors: it holds files but no mark of
/// this command; one of the `inputs` lies in it, also through a link; it cannot be written; another
/// process has it now.
[[nodiscard]] Expected<FolderLock> open_out_folder(
    const std::filesystem::path& folder,
    const std::string& command,
    const std::vector<std::filesystem::path>& inputs);

/// Error: the file to write is one of the inputs, also through a link.
[[nodiscard]] Status check_is_no_input(const std::filesystem::path& file,
                                       const std::vector<std::filesystem::path>& inputs);

/// Files that are read for a source's frames, its model and what was asked for; some need not be
/// there, and a mask may also be a rectangle, which is no file.
[[nodiscard]] std::vector<std::filesystem::path> input_files(const FrameSourceRequest& request,
                                                             const FrameSource& source,
                                                             const Config& config);

}  // namespace stemvo::pipeline
