// SPDX-License-Identifier: MIT
#include "stem/model_file.hpp"

#include <fmt/format.h>

#include "default_stem.hpp"
#include "stem/sampling.hpp"
#include "stem/window_check.hpp"
#include "text/text_file.hpp"

namespace stemvo::internal {

namespace {

constexpr const char* kBuiltIn = "built in";

/// Of a file, or one that is part of the library.
Expected<std::string> read_graph(const std::filesystem::path& file) {
  if (file.parent_path() != kBuiltIn) {
    return read_text_file(file);
  }
  const auto bytes = [](const auto& data) { return std::string(data.begin(), data.end()); };
  return file.filename() == "default.onnx" ? bytes(kDefaultOnnx) : bytes(kDefaultFilterOnnx);
}

}  // namespace

/// As models/manifest.yaml says.
StemNetwork built_in_network() {
  const std::filesystem::path folder = kBuiltIn;
  StemNetwork network;
  network.name = "default";
  network.file = folder / "default.onnx";
  network.layer = "stem";
  network.num_filters = 16;
  network.kernel_px = {4, 4};
  network.stride_px = 4;
  network.default_filter = 2;
  network.folded = {2, 2, folder / "filter.onnx", ""};
  return network;
}

std::optional<StemNetwork> folded_network(const StemNetwork& network) {
  if (!network.folded) {
    return std::nullopt;
  }
  StemNetwork folded = network;
  folded.file = network.folded->file;
  folded.sha256 = network.folded->sha256;
  folded.num_filters = 1;
  folded.default_filter = 0;
  folded.stride_px = network.folded->sampling_px;
  folded.folded.reset();
  return folded;
}

Expected<OnnxSession> open_model(const StemNetwork& network) {
  const std::string file = network.file.string();
  const auto bytes = read_graph(network.file);
  if (!bytes) {
    return bytes.error();
  }
  if (!network.sha256.empty()) {
    if (const std::string hash = sha256_hex(*bytes); hash != network.sha256) {
      return fail(fmt::format("{}: expected sha256 {}, found {}", file, network.sha256, hash));
    }
  }
  auto session = OnnxSession::create(file, *bytes, network.layer);
  if (!session) {
    return session;
  }
  if (session->num_filters() != network.num_filters) {
    return fail(fmt::format("{}: expected {} filters, found {}", file, network.num_filters,
                            session->num_filters()));
  }
  const SamplingPlan native(network, network.stride_px);
  Status status = network.native_sampling_only ? check_sizes(file, *session, native)
                                               : check_window(file, *session, native);
  if (!status) {
    return status.error();
  }
  return session;
}

}  // namespace stemvo::internal
