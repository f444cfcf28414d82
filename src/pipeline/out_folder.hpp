// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <memory>
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
/// The same, and no other process has it while the lock lives. Error: one has it now.
[[nodiscard]] Expected<FolderLock> open_out_folder(const std::filesystem::path& folder);

/// Creates OUT_DIR/pictures and removes what an earlier run left there, so that images of one run
/// are not taken for another's: files of six digits and ".png", nothing else. Error: they are not
/// an earlier run's (the folder is a link, or no frames.csv lies in OUT_DIR), or one cannot be
/// removed.
[[nodiscard]] Status prepare_pictures(const std::filesystem::path& out_dir);

/// Every file that is read for a source's frames and its configuration, as far as they know it.
[[nodiscard]] std::vector<std::filesystem::path> input_files(const FrameSource& source,
                                                             const Config& config);

}  // namespace stemvo::pipeline
