// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include "stemvo/config.hpp"
#include "stemvo/dataset/sequence.hpp"
#include "stemvo/error.hpp"

namespace stemvo::benchmark {

/// SHA-256 of everything a result depends on, part by part so that a change can be named.
struct Fingerprint {
  std::string configuration;  ///< every key
  std::string program;        ///< its version; of one without a clean commit the file as well
  std::string model;          ///< the manifest's entry, which holds the model's hash
  std::string frames;         ///< names and sizes in bytes
  std::string calibration;    ///< calib.txt and times.txt
  std::string ground_truth;   ///< the pose file
};
bool operator==(const Fingerprint& a, const Fingerprint& b);

/// What tells whether the frames are those of before.
enum class FrameIdentity {
  kNamesAndSizes,  ///< at once; a frame replaced by another one of the same size is not noticed
  kContents,       ///< reads every frame: some 0.3 s per GB that is in memory
};

/// The parts of a fingerprint that belong to a sequence.
struct SequenceHashes {
  std::string frames;
  std::string calibration;
  std::string ground_truth;
};

/// Errors: a file that cannot be read. A frame that cannot is none: a run skips it too.
[[nodiscard]] Expected<SequenceHashes> hash_sequence(const KittiSequence& sequence,
                                                     const std::filesystem::path& sequence_dir,
                                                     FrameIdentity frames);
/// Of the model's file and entry. Error: a model that is not there.
[[nodiscard]] Expected<std::string> hash_model(const Config& config,
                                               const std::filesystem::path& models_dir);
[[nodiscard]] Expected<std::string> hash_program();

/// Of all parts, the frames by name and size. Errors: those of the above.
[[nodiscard]] Expected<Fingerprint> make_fingerprint(const Config& config,
                                                     const KittiSequence& sequence,
                                                     const std::filesystem::path& sequence_dir,
                                                     const std::filesystem::path& models_dir);

/// Beside the files of a run that is done; written last.
[[nodiscard]] Status write_fingerprint(const std::filesystem::path& run_dir, const Fingerprint& of);
/// No file: the run was never finished.
[[nodiscard]] Expected<Fingerprint> read_fingerprint(const std::filesystem::path& run_dir);
/// Before a run starts, so that an interrupted one does not pass for done.
void remove_fingerprint(const std::filesystem::path& run_dir);

/// "the configuration and the frames changed"; empty where nothing did.
[[nodiscard]] std::string describe_change(const Fingerprint& before, const Fingerprint& now);

}  // namespace stemvo::benchmark
