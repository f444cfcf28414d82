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

/// While one lives no other process writes into the folder, as far as it asks for a lock too. An
/// advisory lock of the folder itself: nothing lies in it, and the kernel lets go of it however the
/// process ends.
using FolderLock = std::shared_ptr<void>;
/// Of a folder that is there. Error: another one has it. On a file system without locks it is taken
/// without one.
[[nodiscard]] Expected<FolderLock> lock_folder(const std::filesystem::path& folder);

/// Creates the folder (and those above it) and proves that files can be written there. Error: the
/// folder, what was expected, what the system says.
[[nodiscard]] Status create_out_folder(const std::filesystem::path& folder);
/// The same, and no other process has it while the lock lives; every command with a folder asks
/// for it so. Errors, before anything is created: one of the files or folders it is to hold
/// (`names`) is one of the `inputs`, also through a link; another process has it now.
[[nodiscard]] Expected<FolderLock> open_out_folder(
    const std::filesystem::path& folder,
    const std::vector<std::string>& names,
    const std::vector<std::filesystem::path>& inputs);

/// Every file that is read for a source's frames, its configuration and its model, as far as they
/// know it; some need not be there.
[[nodiscard]] std::vector<std::filesystem::path> input_files(
    const FrameSource& source, const Config& config, const std::filesystem::path& models_dir);
/// The same with what was asked for: `--mask` may also be a rectangle, which is no file.
[[nodiscard]] std::vector<std::filesystem::path> input_files(
    const FrameSourceRequest& request,
    const FrameSource& source,
    const Config& config,
    const std::filesystem::path& models_dir);

}  // namespace stemvo::pipeline
