// SPDX-License-Identifier: MIT
#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "models/manifest.hpp"
#include "options/option_fields.hpp"
#include "pipeline/input_hashes.hpp"
#include "search/plan.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;

/// Shifted passes of a coarse layer cost more than they tell.
constexpr int kMaxShifts = 2;

bool is_input(const std::string& model) { return model == "gray" || model == "input_layer"; }

/// 0: every second pixel where that takes no more than 4 passes, else half the stride.
int sampling_of(int asked, const ModelEntry& entry) {
  if (asked != 0 || entry.native_sampling_only) {
    return asked;
  }
  for (int sampling = 2; sampling < entry.stride_px; ++sampling) {
    if (entry.stride_px % sampling == 0 && entry.stride_px / sampling <= kMaxShifts) {
      return sampling;
    }
  }
  return entry.stride_px;
}

/// An .onnx is found from any folder later on.
std::string from_anywhere(const std::string& model) {
  std::error_code ignored;
  return model.ends_with(".onnx") ? fs::absolute(model, ignored).lexically_normal().string()
                                  : model;
}

/// The model's layers, or those asked for in that order; without what the loaded stem says.
Expected<std::vector<LayerIdentity>> model_layers(const SearchRequest& request) {
  LayerIdentity layer;
  layer.model = request.model;
  layer.layer = kInputLayer;
  layer.features = options::to_string(request.config.features.method);
  layer.sampling_px = request.config.stem.sampling_px;
  layer.stem_model = from_anywhere(request.model);
  if (is_input(request.model)) {
    if (!request.layers.empty()) {
      return fail(fmt::format("--layers: expected none for {}, found '{}'", request.model,
                              fmt::join(request.layers, ",")));
    }
    return std::vector{layer};
  }
  const auto entries = find_layers(request.model, request.models_dir);
  if (!entries) {
    return entries.error();
  }
  std::vector<LayerIdentity> known;
  std::vector<std::string> names;
  for (const ModelEntry& entry : *entries) {
    layer.model = entry.name;
    layer.layer = entry.layer;
    layer.sampling_px = sampling_of(request.config.stem.sampling_px, entry);
    known.push_back(layer);
    names.push_back(entry.layer);
  }
  std::vector<LayerIdentity> chosen;
  for (const std::string& name : request.layers) {
    const auto found = std::ranges::find(known, name, &LayerIdentity::layer);
    if (found == known.end()) {
      return fail(fmt::format("--layers: {}: expected one of {}, found '{}'", request.model,
                              fmt::join(names, ", "), name));
    }
    chosen.push_back(*found);
  }
  return chosen.empty() ? known : chosen;
}

/// ORB on gray, and R, G, B; not where they are what is searched.
void add_baselines(const SearchRequest& request, std::vector<LayerIdentity>& layers) {
  for (const std::string model : {"gray", "input_layer"}) {
    LayerIdentity layer;
    layer.model = model;
    layer.layer = kInputLayer;
    layer.features =
        options::to_string(model == "gray" ? FeatureMethod::kOrb : request.config.features.method);
    layer.stem_model = model;
    layer.baseline = true;
    const bool is_searched = std::ranges::any_of(
        layers, [&](const LayerIdentity& one) { return one.is_layer_of(layer.key(0)); });
    if (!is_searched) {
      layers.push_back(layer);
    }
  }
}

Status load_layer(const SearchRequest& request, LayerIdentity layer, SearchPlan& plan) {
  const Config config = config_of(request.config, layer, 0);
  Expected<Stem> stem = create_stem(config.stem, request.models_dir);
  if (!stem) {
    return stem.error();
  }
  const StemInfo& info = stem->info();
  const auto count = static_cast<std::size_t>(info.num_filters);
  const FrameRangeRequest asked =
      layer.baseline ? FrameRangeRequest() : request.filters.value_or(FrameRangeRequest());
  const FrameRange filters{asked.begin, asked.end.value_or(count)};
  if (filters.begin >= filters.end || filters.end > count) {
    return fail(fmt::format("--filters: expected filters inside 0:{} of {}{}, found {}:{}", count,
                            request.model, info.layer.empty() ? "" : " layer " + info.layer,
                            filters.begin, filters.end));
  }
  const auto hash = pipeline::hash_model(config, request.models_dir);
  if (!hash) {
    return hash.error();
  }
  layer.first = static_cast<int>(filters.begin);
  layer.last = static_cast<int>(filters.end);
  layer.hash = *hash;
  layer.sampling_px = info.sampling_px;
  for (int filter = layer.first; filter < layer.last; ++filter) {
    plan.candidates.push_back({.key = {layer.model, layer.layer, layer.features, filter},
                               .layer = plan.layers.size(),
                               .is_baseline = layer.baseline});
  }
  // Gray and R, G, B take no pass: one for all.
  const bool goes_on =
      !plan.layers.empty() && is_input(layer.model) && is_input(plan.identity.layers.back().model);
  const std::size_t pass = goes_on ? plan.layers.back().pass : plan.layers.size();
  plan.layers.push_back({config, std::move(*stem), pass});
  plan.identity.layers.push_back(std::move(layer));
  return {};
}

}  // namespace

Config config_of(Config common, const LayerIdentity& layer, int filter) {
  common.stem.model = layer.stem_model;
  common.stem.layer = is_input(layer.model) ? StemOptions().layer : layer.layer;
  common.stem.filter = filter;
  common.stem.sampling_px = layer.sampling_px;
  common.features.method = options::feature_method(layer.features);
  return common;
}

Status add_layers(const SearchRequest& request, SearchPlan& plan) {
  Expected<std::vector<LayerIdentity>> layers = model_layers(request);
  if (!layers) {
    return layers.error();
  }
  if (request.baselines) {
    add_baselines(request, *layers);
  }
  for (const LayerIdentity& layer : *layers) {
    if (Status status = load_layer(request, layer, plan); !status) {
      return status;
    }
  }
  return {};
}

}  // namespace stemvo::search
