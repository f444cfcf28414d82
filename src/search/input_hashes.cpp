// SPDX-License-Identifier: MIT
#include "search/input_hashes.hpp"

#include <system_error>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/sha256.hpp"
#include "stem/hand_made.hpp"
#include "stem/model.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;
using internal::sha256_hex;

std::string identity_of(const fs::path& file, FrameIdentity identity) {
  if (identity == FrameIdentity::kContents) {
    const auto bytes = read_text_file(file);
    return bytes ? sha256_hex(*bytes) : "unreadable";
  }
  std::error_code code;
  const auto size = fs::file_size(file, code);
  return code ? "unreadable" : std::to_string(size);
}

Expected<std::string> hash_files(const std::vector<fs::path>& files) {
  std::string text;
  for (const fs::path& file : files) {
    const auto bytes = read_text_file(file);
    if (!bytes) {
      return bytes.error();
    }
    text += fmt::format("{} {}\n", bytes->size(), *bytes);
  }
  return sha256_hex(text);
}

}  // namespace

Expected<SequenceHashes> hash_sequence(const FrameSource& sequence,
                                       const fs::path& sequence_dir,
                                       FrameIdentity frames) {
  std::vector<fs::path> truth;
  if (sequence.ground_truth_file) {
    truth.push_back(*sequence.ground_truth_file);
  }
  const auto calibration = hash_files({sequence_dir / "calib.txt", sequence_dir / "times.txt"});
  const auto ground_truth = hash_files(truth);
  if (!calibration || !ground_truth) {
    return (calibration ? ground_truth : calibration).error();
  }
  std::string text;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const fs::path& file = sequence.files[i];
    text += fmt::format("{} {}\n", (file.parent_path().filename() / file.filename()).string(),
                        identity_of(file, frames));
  }
  return SequenceHashes{sha256_hex(text), *calibration, *ground_truth};
}

Expected<std::string> hash_model(const std::string& model) {
  return is_hand_made(model) ? sha256_hex(model) : read_model(model).map(sha256_hex);
}

/// A build without a clean commit has a version that does not change with its code.
Expected<std::string> hash_program() {
  const std::string text(version());
  if (text.find('+') != std::string::npos && !text.ends_with(".dirty")) {
    return sha256_hex(text);
  }
  return read_text_file("/proc/self/exe").map([&](const std::string& bytes) {
    return sha256_hex(text + " " + sha256_hex(bytes));
  });
}

}  // namespace stemvo::search
