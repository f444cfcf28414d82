// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "stemvo/error.hpp"

/// Hashes of what a result depends on, so that kept results can be told from outdated ones.
namespace stemvo::search {

/// How frames are compared with those of before.
enum class FrameIdentity {
  kNamesAndSizes,  ///< at once; a frame replaced by another one of the same size is not noticed
  kContents,       ///< reads every frame: some 0.3 s per GB that is in memory
};

/// SHA-256 of what a sequence consists of.
struct SequenceHashes {
  std::string frames;
  std::string calibration;   ///< calib.txt and times.txt
  std::string ground_truth;  ///< the pose file
};

/// Errors: a file that cannot be read. A frame that cannot is none: a run skips it too.
[[nodiscard]] Expected<SequenceHashes> hash_sequence(const FrameSource& sequence,
                                                     const std::filesystem::path& sequence_dir,
                                                     FrameIdentity frames);
/// Hashes the model's file. Error: a model that is not there.
[[nodiscard]] Expected<std::string> hash_model(const std::string& model);
/// Hashes the version; for a build without a clean commit the file as well.
[[nodiscard]] Expected<std::string> hash_program();

}  // namespace stemvo::search
