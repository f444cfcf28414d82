// SPDX-License-Identifier: MIT
#include <algorithm>
#include <filesystem>
#include <iterator>
#include <system_error>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "models/manifest.hpp"
#include "stem/model_file.hpp"

namespace stemvo {
namespace {

constexpr const char* kManifest = "manifest.yaml";

Expected<std::vector<ModelEntry>> find_by_path(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) {
    return fail(fmt::format("{}: no such file", file.string()));
  }
  const std::filesystem::path manifest = std::filesystem::absolute(file).parent_path() / kManifest;
  if (!std::filesystem::exists(manifest, ignored)) {
    return fail(fmt::format(
        "{}: expected a {} beside it, which says kernel, stride and padding, found none",
        file.string(), kManifest));
  }
  const auto entries = load_manifest(manifest);
  if (!entries) {
    return entries.error();
  }
  std::vector<ModelEntry> found;
  std::copy_if(entries->begin(), entries->end(), std::back_inserter(found),
               [&](const ModelEntry& entry) { return entry.file.filename() == file.filename(); });
  if (found.empty()) {
    return fail(fmt::format("{}: expected an entry with 'file: {}', found none", manifest.string(),
                            file.filename().string()));
  }
  return found;
}

Expected<std::vector<ModelEntry>> find_by_name(const std::string& model,
                                               const std::filesystem::path& manifest) {
  auto entries = load_manifest(manifest);
  if (!entries) {
    return entries;
  }
  std::vector<ModelEntry> found;
  std::vector<std::string> known;
  for (ModelEntry& entry : *entries) {
    if (known.empty() || known.back() != entry.name) {
      known.push_back(entry.name);
    }
    if (entry.name == model) {
      found.push_back(std::move(entry));
    }
  }
  if (!found.empty()) {
    return found;
  }
  known.insert(known.end(), {"gray", "input_layer", "the path of an .onnx"});
  return fail(fmt::format("{}: stem.model: expected one of {}, found '{}'", manifest.string(),
                          fmt::join(known, ", "), model));
}

}  // namespace

Expected<ModelEntry> find_model(const std::string& model,
                                const std::string& layer,
                                const std::filesystem::path& models_dir) {
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

Expected<StemOptions> with_network(StemOptions options, const std::filesystem::path& models_dir) {
  if (options.model == "gray" || options.model == "input_layer") {
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

Expected<std::vector<ModelEntry>> find_layers(const std::string& model,
                                              const std::filesystem::path& models_dir) {
  return model.ends_with(".onnx") ? find_by_path(model)
                                  : find_by_name(model, models_dir / kManifest);
}

Status check_model(const ModelEntry& entry) {
  auto session = internal::open_model(entry);
  if (const auto folded = internal::folded_network(entry); session && folded) {
    session = internal::open_model(*folded);
  }
  return session ? Status() : session.error();
}

Expected<Stem> create_stem(const StemOptions& options, const std::filesystem::path& models_dir) {
  const auto found = with_network(options, models_dir);
  if (!found) {
    return found.error();
  }
  return Stem::create_all(*found);
}

}  // namespace stemvo
