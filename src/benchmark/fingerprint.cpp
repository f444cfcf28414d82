// SPDX-License-Identifier: MIT
#include "benchmark/fingerprint.hpp"

#include <array>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "stem/model_file.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo::benchmark {
namespace {

namespace fs = std::filesystem;
using internal::read_bytes;
using internal::sha256_hex;

constexpr const char* kFile = "benchmark_inputs.json";

struct Part {
  const char* key;
  const char* words;
  std::string Fingerprint::* value;
};
constexpr std::array<Part, 6> kParts = {{
    {"configuration", "the configuration", &Fingerprint::configuration},
    {"program", "the program", &Fingerprint::program},
    {"model", "the model", &Fingerprint::model},
    {"frames", "the frames", &Fingerprint::frames},
    {"calibration", "calib.txt or times.txt", &Fingerprint::calibration},
    {"ground_truth", "the pose file", &Fingerprint::ground_truth},
}};

std::string sha256_of(const std::string& text) { return sha256_hex(text); }

/// A build without a clean commit has a version that does not change with its code.
Expected<std::string> program_identity() {
  const std::string text(version());
  if (text.find('+') != std::string::npos && !text.ends_with(".dirty")) {
    return text;
  }
  return read_bytes("/proc/self/exe").map([&](const std::string& bytes) {
    return text + " " + sha256_hex(bytes);
  });
}

Expected<std::string> model_identity(const Config& config, const fs::path& models_dir) {
  const std::string& model = config.stem.model;
  if (model == "gray" || model == "input_layer") {
    return model;
  }
  return internal::find_model(model, config.stem.layer, models_dir)
      .map([](const ModelEntry& entry) {
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
  const auto bytes = read_bytes(file);
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
    const auto bytes = read_bytes(file);
    if (!bytes) {
      return bytes.error();
    }
    text += fmt::format("{} {}\n", bytes->size(), *bytes);
  }
  return text;
}

}  // namespace

bool operator==(const Fingerprint& a, const Fingerprint& b) {
  return describe_change(a, b).empty();
}

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

Expected<Fingerprint> make_fingerprint(const Config& config,
                                       const KittiSequence& sequence,
                                       const fs::path& sequence_dir,
                                       const fs::path& models_dir) {
  const auto program = hash_program();
  if (!program) {
    return program.error();
  }
  const auto model = hash_model(config, models_dir);
  if (!model) {
    return model.error();
  }
  const auto inputs = hash_sequence(sequence, sequence_dir, FrameIdentity::kNamesAndSizes);
  if (!inputs) {
    return inputs.error();
  }
  return Fingerprint{.configuration = sha256_hex(dump_config(config)),
                     .program = *program,
                     .model = *model,
                     .frames = inputs->frames,
                     .calibration = inputs->calibration,
                     .ground_truth = inputs->ground_truth};
}

Status write_fingerprint(const fs::path& run_dir, const Fingerprint& of) {
  nlohmann::ordered_json json;
  for (const Part& part : kParts) {
    json[part.key] = of.*part.value;
  }
  return write_text_file(run_dir / kFile, json.dump(2) + '\n');
}

Expected<Fingerprint> read_fingerprint(const fs::path& run_dir) {
  const Expected<std::string> text = read_text_file(run_dir / kFile);
  if (!text) {
    return text.error();
  }
  try {
    const nlohmann::json json = nlohmann::json::parse(*text);
    Fingerprint result;
    for (const Part& part : kParts) {
      result.*part.value = json.at(part.key).get<std::string>();
    }
    return result;
  } catch (const nlohmann::json::exception& error) {
    return fail(
        fmt::format("{}: expected hashes, found: {}", (run_dir / kFile).string(), error.what()));
  }
}

void remove_fingerprint(const fs::path& run_dir) {
  std::error_code ignored;
  fs::remove(run_dir / kFile, ignored);
}

std::string describe_change(const Fingerprint& before, const Fingerprint& now) {
  std::vector<std::string_view> changed;
  for (const Part& part : kParts) {
    if (before.*part.value != now.*part.value) {
      changed.emplace_back(part.words);
    }
  }
  return changed.empty() ? std::string() : fmt::format("{} changed", fmt::join(changed, " and "));
}

}  // namespace stemvo::benchmark
