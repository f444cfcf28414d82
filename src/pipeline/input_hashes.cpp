// SPDX-License-Identifier: MIT
#include "pipeline/input_hashes.hpp"

#include <system_error>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "models/manifest.hpp"
#include "stem/model_file.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo::pipeline {
namespace {

namespace fs = std::filesystem;
using internal::sha256_hex;

std::string sha256_of(const std::string& text) { return sha256_hex(text); }

/// A build without a clean commit has a version that does not change with its code.
Expected<std::string> program_identity() {
  const std::string text(version());
  if (text.find('+') != std::string::npos && !text.ends_with(".dirty")) {
    return text;
  }
  return read_text_file("/proc/self/exe").map([&](const std::string& bytes) {
    return text + " " + sha256_hex(bytes);
  });
}

Expected<std::string> model_identity(const Config& config, const fs::path& models_dir) {
  const std::string& model = config.stem.model;
  if (model == "gray" || model == "input_layer") {
    return model;
  }
  return find_model(model, config.stem.layer, models_dir).map([](const ModelEntry& entry) {
    return fmt::format("{} {} {} {} {} {} {} {}", entry.sha256, entry.layer, entry.num_filters,
                       entry.kernel_px, entry.stride_px, entry.padding_px, entry.default_filter,
                       entry.native_sampling_only ? "native" : "any");
  });
}

std::string size_of(const fs::path& file) {
  std::error_code code;
  const auto size = fs::file_size(file, code);
  return code ? std::string("unreadable") : std::to_string(size);
}

std::string hash_of(const fs::path& file) {
  const auto bytes = read_text_file(file);
  return bytes ? sha256_hex(*bytes) : std::string("unreadable");
}

std::string frames_identity(const KittiSequence& sequence, FrameIdentity identity) {
  std::string text;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const fs::path& file = sequence.file(i);
    text += fmt::format("{} {}\n", (file.parent_path().filename() / file.filename()).string(),
                        identity == FrameIdentity::kContents ? hash_of(file) : size_of(file));
  }
  return text;
}

Expected<std::string> files_identity(const std::vector<fs::path>& files) {
  std::string text;
  for (const fs::path& file : files) {
    const auto bytes = read_text_file(file);
    if (!bytes) {
      return bytes.error();
    }
    text += fmt::format("{} {}\n", bytes->size(), *bytes);
  }
  return text;
}

}  // namespace

Expected<SequenceHashes> hash_sequence(const KittiSequence& sequence,
                                       const fs::path& sequence_dir,
                                       FrameIdentity frames) {
  std::vector<fs::path> truth;
  if (sequence.ground_truth_file()) {
    truth.push_back(*sequence.ground_truth_file());
  }
  const auto calibration = files_identity({sequence_dir / "calib.txt", sequence_dir / "times.txt"});
  if (!calibration) {
    return calibration.error();
  }
  const auto ground_truth = files_identity(truth);
  if (!ground_truth) {
    return ground_truth.error();
  }
  return SequenceHashes{sha256_hex(frames_identity(sequence, frames)), sha256_hex(*calibration),
                        sha256_hex(*ground_truth)};
}

Expected<std::string> hash_model(const Config& config, const fs::path& models_dir) {
  return model_identity(config, models_dir).map(sha256_of);
}

Expected<std::string> hash_program() { return program_identity().map(sha256_of); }

}  // namespace stemvo::pipeline
