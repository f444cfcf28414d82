// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "stemvo/error.hpp"

/// What an earlier run left in the folder that the next one writes into.
namespace stemvo::pipeline {

/// Files that a run writes into its folder.
[[nodiscard]] std::vector<std::string> run_files();

/// Its frames.csv tells it.
[[nodiscard]] bool has_earlier_run(const std::filesystem::path& out_dir);

/// OUT_DIR/pictures/NNNNNN.png; none through a link.
[[nodiscard]] std::vector<std::filesystem::path> old_pictures(const std::filesystem::path& out_dir);

/// Error: OUT_DIR/pictures is a link, or holds files of six digits and ".png" where no run has been
/// (no frames.csv of a run in OUT_DIR): they are not for us to remove.
[[nodiscard]] Status check_pictures(const std::filesystem::path& out_dir);

/// Where a run has been: its results and pictures, which would pass for those of one that is killed
/// before it has its own; its frames.csv is left without a frame. But for config.yaml, which may be
/// what this run was given, and which it replaces before it writes anything else. Links stay.
/// Error: one cannot be removed.
[[nodiscard]] Status remove_earlier_results(const std::filesystem::path& out_dir);

}  // namespace stemvo::pipeline
