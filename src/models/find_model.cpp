// SPDX-License-Identifier: MIT
#include <filesystem>
#include <system_error>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "models/manifest.hpp"
#include "stem/hand_made.hpp"
#include "stem/model_file.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

constexpr const char* kManifest = "manifest.yaml";

/// The manifest that lists a model given by its path. Error: no such file, or none beside it.
Expected<fs::path> manifest_beside(const fs::path& file) {
  std::error_code ignored;
  if (!fs::exists(file, ignored)) {
    return fail(fmt::format("{}: no such file; check the path", file.string()));
  }
  const fs::path manifest = fs::absolute(file).parent_path() / kManifest;
  if (!fs::exists(manifest, ignored)) {
    return fail(fmt::format(
        "{}: expected a {} beside it, which says kernel, stride and padding, found none",
        file.string(), kManifest));
  }
  return manifest;
}

}  // namespace

Expected<std::vector<ModelEntry>> find_layers(const std::string& model,
                                              const fs::path& models_dir) {
  const bool is_path = model.ends_with(".onnx");
  if (!is_path && model.find('/') != model.npos) {
    return fail(fmt::format("{}: expected the name of a model or the path of an .onnx, found {}",
                            model, kind_of(model)));
  }
  const auto manifest =
      is_path ? manifest_beside(model) : Expected<fs::path>(models_dir / kManifest);
  const auto entries = manifest.and_then(load_manifest);
  if (!entries) {
    return entries.error();
  }
  const fs::path file_name = fs::path(model).filename();
  std::vector<ModelEntry> found;
  std::vector<std::string> known;
  for (const ModelEntry& entry : *entries) {
    if (known.empty() || known.back() != entry.name) {
      known.push_back(entry.name);
    }
    if (is_path ? entry.file.filename() == file_name : entry.name == model) {
      found.push_back(entry);
    }
  }
  if (!found.empty()) {
    return found;
  }
  if (is_path) {
    return fail(fmt::format("{}: expected an entry with 'file: {}', found none", manifest->string(),
                            file_name.string()));
  }
  known.insert(known.end(), std::begin(kHandMadeModels), std::end(kHandMadeModels));
  known.emplace_back("the path of an .onnx");
  return fail(fmt::format("{}: stem.model: expected one of {}, found '{}'", manifest->string(),
                          fmt::join(known, ", "), model));
}

Expected<ModelEntry> find_model(const std::string& model,
                                const std::string& layer,
                                const fs::path& models_dir) {
  auto layers = find_layers(model, models_dir);
  if (!layers) {
    return layers.error();
  }
  std::vector<std::string> known;
  for (ModelEntry& entry : *layers) {
    if (layer == "first" || entry.layer == layer) {
      return std::move(entry);
    }
    known.push_back(entry.layer);
  }
  return fail(fmt::format("{}: stem.layer: expected one of {}, found '{}'", model,
                          fmt::join(known, ", "), layer));
}

Expected<StemOptions> with_network(StemOptions options, const fs::path& models_dir) {
  if (is_hand_made(options.model)) {
    return options;
  }
  auto found = find_model(options.model, options.layer, models_dir);
  if (!found) {
    return found.error();
  }
  options.network = static_cast<StemNetwork>(*std::move(found));
  options.network->name = options.model;
  return options;
}

Status check_model(const ModelEntry& entry) {
  auto session = internal::open_model(entry);
  if (session && entry.folded) {
    session = internal::open_model(internal::folded_network(entry));
  }
  return session ? Status() : session.error();
}

Expected<Stem> create_stem(const StemOptions& options, const fs::path& models_dir) {
  const auto found = with_network(options, models_dir);
  if (!found) {
    return found.error();
  }
  return Stem::create_all(*found);
}

}  // namespace stemvo
