// SPDX-License-Identifier: MIT
#include "benchmark/kept_run.hpp"

#include <system_error>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/sha256.hpp"
#include "pipeline/result_files.hpp"
#include "report/metrics_keys.hpp"
#include "search/input_hashes.hpp"
#include "text/text_file.hpp"

namespace stemvo::benchmark {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// With the hashes of the results beside them: one that was touched does not count.
Json with_results(const fs::path& folder, Json hashes) {
  for (const char* name : pipeline::kResultNames) {
    const Expected<std::string> text = read_text_file(folder / name);
    hashes[name] = text ? internal::sha256_hex(*text) : "cannot be read";
  }
  return hashes;
}

}  // namespace

Expected<Json> hash_inputs(const RunRequest& run, const FrameSource& sequence) {
  Config config = run.config;
  config.threads = 0;  // no result depends on them
  const auto program = search::hash_program();
  const auto model = search::hash_model(run.config.stem.model);
  const auto files =
      search::hash_sequence(sequence, run.sequence_dir, search::FrameIdentity::kNamesAndSizes);
  if (!program || !model || !files) {
    return !program ? program.error() : !model ? model.error() : files.error();
  }
  return Json{{"configuration", internal::sha256_hex(dump_config(config))},
              {"program", *program},
              {"model", *model},
              {"frames", files->frames},
              {"calibration", files->calibration},
              {"ground_truth", files->ground_truth}};
}

std::optional<std::string> reason_to_run(const fs::path& folder, const Json& inputs) {
  std::error_code ignored;
  if (!fs::exists(folder / kInputsFile, ignored)) {
    return "";  // never completed
  }
  const Expected<Json> before = read_json_object(folder / kInputsFile);
  if (!before) {
    return fmt::format(" (again: {})", before.error().message);
  }
  const Json now = with_results(folder, inputs);
  std::vector<std::string> changed;
  for (const auto& [part, hash] : now.items()) {
    if (before->value(part, Json()) != hash) {
      changed.push_back(part);
    }
  }
  return changed.empty()
             ? std::nullopt
             : std::optional(fmt::format(" (again: {} changed)", fmt::join(changed, ", ")));
}

Status keep_run(const fs::path& folder, const Json& inputs) {
  return write_text_file(folder / kInputsFile, to_text(with_results(folder, inputs)));
}

}  // namespace stemvo::benchmark
