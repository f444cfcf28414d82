// SPDX-License-Identifier: MIT
#include "stem/model_file.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "stem/sampling.hpp"
#include "stem/window_check.hpp"

namespace stemvo::internal {
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

Expected<std::string> read_bytes(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    return fail(fmt::format("{}: expected a file, found a folder", file.string()));
  }
  std::ifstream stream(file, std::ios::binary);
  std::string bytes;
  std::array<char, 1 << 16> buffer;
  while (stream.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) ||
         stream.gcount() > 0) {
    bytes.append(buffer.data(), static_cast<std::size_t>(stream.gcount()));
  }
  if (!stream.eof()) {  // not opened, or broken in the middle
    return fail(
        fmt::format("{}: cannot read: {}", file.string(), std::generic_category().message(errno)));
  }
  return bytes;
}

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

std::optional<ModelEntry> folded_entry(const ModelEntry& entry) {
  if (!entry.folded) {
    return std::nullopt;
  }
  ModelEntry folded = entry;
  folded.file = entry.folded->file;
  folded.sha256 = entry.folded->sha256;
  folded.num_filters = 1;
  folded.default_filter = 0;
  folded.stride_px = entry.folded->sampling_px;
  folded.folded.reset();
  return folded;
}

Expected<OnnxSession> open_model(const ModelEntry& entry) {
  const std::string file = entry.file.string();
  const auto bytes = read_bytes(entry.file);
  if (!bytes) {
    return bytes.error();
  }
  if (const std::string hash = sha256_hex(*bytes); hash != entry.sha256) {
    return fail(fmt::format("{}: expected sha256 {} as in the manifest, found {}", file,
                            entry.sha256, hash));
  }
  auto session = OnnxSession::create(file, *bytes, entry.layer);
  if (!session) {
    return session;
  }
  if (session->num_filters() != entry.num_filters) {
    return fail(fmt::format("{}: expected {} filters as in the manifest, found {}", file,
                            entry.num_filters, session->num_filters()));
  }
  const SamplingPlan native(entry, entry.stride_px);
  Status status = entry.native_sampling_only ? check_sizes(file, *session, native)
                                             : check_window(file, *session, native);
  if (!status) {
    return status.error();
  }
  return session;
}

}  // namespace stemvo::internal

namespace stemvo {

Expected<std::vector<ModelEntry>> find_layers(const std::string& model,
                                              const std::filesystem::path& models_dir) {
  return model.ends_with(".onnx") ? internal::find_by_path(model)
                                  : internal::find_by_name(model, models_dir / internal::kManifest);
}

Status check_model(const ModelEntry& entry) {
  auto session = internal::open_model(entry);
  if (const auto folded = internal::folded_entry(entry); session && folded) {
    session = internal::open_model(*folded);
  }
  return session ? Status() : session.error();
}

}  // namespace stemvo
