// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "pipeline/result_files.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// What a run goes on from: OUT_DIR/checkpoint.
struct Checkpoint {
  std::size_t frame = 0;  ///< it is tracked, those before it are done
  std::string odometry;   ///< PhasedOdometry::state
  Drive drive;            ///< of the frames before
};

[[nodiscard]] std::filesystem::path checkpoint_file(const std::filesystem::path& out_dir);

/// The contents of the file of a Checkpoint, whose drive took `elapsed_s`; megabytes, so that none
/// is made. `identity`: the program and everything the results depend on.
[[nodiscard]] std::string pack(std::size_t frame,
                               const std::string& odometry,
                               const Drive& drive,
                               double elapsed_s,
                               const std::string& identity);

/// Of `num_frames` frames at most. Nullopt: there is none. Error, starting with "--resume: ":
/// damaged, or of another identity.
[[nodiscard]] Expected<std::optional<Checkpoint>> read_checkpoint(const std::filesystem::path& file,
                                                                  const std::string& identity,
                                                                  std::size_t num_frames);
/// .. that it is damaged. `why`: as far as it is known.
[[nodiscard]] Error damaged_checkpoint(const std::filesystem::path& file,
                                       const std::string& why = "");

}  // namespace stemvo::pipeline
