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

Expected<std::string> frames_identity(const KittiSequence& sequence) {
  std::string text;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    std::error_code code;
    const auto size = fs::file_size(sequence.file(i), code);
    const fs::path folder = sequence.file(i).parent_path().filename();
    text += fmt::format("{} {}\n", (folder / sequence.file(i).filename()).string(),
                        code ? std::string("unreadable") : std::to_string(size));
  }
  return text;
}

Expected<std::string> files_identity(const std::vector<fs::path>& files) {
  std::string text;
  for (const fs::path& file : files) {
    const auto bytes = read_bytes(file);
    if (!bytes) {
      return tl::unexpected(bytes.error());
    }
    text += fmt::format("{} {}\n", bytes->size(), *bytes);
  }
  return text;
}

}  // namespace

bool operator==(const Fingerprint& a, const Fingerprint& b) {
  return describe_change(a, b).empty();
}

Expected<Fingerprint> make_fingerprint(const Config& config,
                                       const KittiSequence& sequence,
                                       const fs::path& sequence_dir,
                                       const fs::path& models_dir) {
  std::vector<fs::path> truth;
  if (sequence.ground_truth_file()) {
    truth.push_back(*sequence.ground_truth_file());
  }
  std::array<Expected<std::string>, kParts.size()> texts = {
      dump_config(config),
      program_identity(),
      model_identity(config, models_dir),
      frames_identity(sequence),
      files_identity({sequence_dir / "calib.txt", sequence_dir / "times.txt"}),
      files_identity(truth)};
  Fingerprint result;
  for (std::size_t i = 0; i < kParts.size(); ++i) {
    if (!texts[i]) {
      return tl::unexpected(texts[i].error());
    }
    result.*kParts[i].value = sha256_hex(*texts[i]);
  }
  return result;
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
    return tl::unexpected(text.error());
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
