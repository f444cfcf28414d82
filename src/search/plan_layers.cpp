// SPDX-License-Identifier: MIT
#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "search/plan.hpp"
#include "stemvo/stem/manifest.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;

/// Shifted passes of a coarse layer cost more than they tell.
constexpr int kMostShifts = 2;

bool is_input(const std::string& model) { return model == "gray" || model == "input_layer"; }

/// 0: every second pixel where that takes no more than 4 passes, else half the stride.
int sampling_of(int asked, const ModelEntry& entry) {
  if (asked != 0 || entry.native_sampling_only) {
    return asked;
  }
  for (int sampling = 2; sampling < entry.stride_px; ++sampling) {
    if (entry.stride_px % sampling == 0 && entry.stride_px / sampling <= kMostShifts) {
      return sampling;
    }
  }
  return entry.stride_px;
}

/// The model's layers, or those asked for in that order.
Expected<std::vector<ModelEntry>> find_entries(const SearchRequest& request) {
  const Expected<std::vector<ModelEntry>> all = find_layers(request.model, request.models_dir);
  if (!all || request.layers.empty()) {
    return all;
  }
  std::vector<std::string> known;
  for (const ModelEntry& one : *all) {
    known.push_back(one.layer);
  }
  std::vector<ModelEntry> chosen;
  for (const std::string& layer : request.layers) {
    const auto found = std::find_if(all->begin(), all->end(),
                                    [&](const ModelEntry& one) { return one.layer == layer; });
    if (found == all->end()) {
      return fail(fmt::format("--layers: {}: expected one of {}, found '{}'", request.model,
                              fmt::join(known, ", "), layer));
    }
    chosen.push_back(*found);
  }
  return chosen;
}

/// An .onnx is found from any folder later on.
std::string from_anywhere(const std::string& model) {
  std::error_code ignored;
  return model.ends_with(".onnx") ? fs::absolute(model, ignored).lexically_normal().string()
                                  : model;
}

Expected<FrameRange> filters_of(const SearchRequest& request, const StemInfo& info) {
  const auto count = static_cast<std::size_t>(info.num_filters);
  if (!request.filters) {
    return FrameRange{0, count};
  }
  const FrameRange range{request.filters->begin, request.filters->end.value_or(count)};
  if (range.begin >= range.end || range.end > count) {
    return fail(fmt::format("--filters: expected filters inside 0:{} of {}{}, found {}:{}", count,
                            request.model, info.layer.empty() ? "" : " layer " + info.layer,
                            range.begin, range.end));
  }
  return range;
}

Expected<PlanLayer> make_layer(Config config,
                               const std::string& model,
                               const std::string& layer,
                               const SearchRequest& request,
                               bool all_filters) {
  Expected<Stem> stem = Stem::create(config.stem, request.models_dir);
  if (!stem) {
    return stem.error();
  }
  Expected<FrameRange> filters = filters_of(request, stem->info());
  if (all_filters) {
    filters = FrameRange{0, static_cast<std::size_t>(stem->info().num_filters)};
  }
  if (!filters) {
    return filters.error();
  }
  return PlanLayer{model,
                   layer,
                   std::move(config),
                   std::move(*stem),
                   static_cast<int>(filters->begin),
                   static_cast<int>(filters->end)};
}

/// Those of the model, without the baselines.
Status add_model(const SearchRequest& request, std::vector<PlanLayer>& layers) {
  Config config = request.config;
  config.stem.model = from_anywhere(request.model);
  config.stem.layer = StemOptions().layer;
  config.stem.filter = 0;
  if (is_input(request.model)) {
    if (!request.layers.empty()) {
      return fail(fmt::format("--layers: expected none for {}, found '{}'", request.model,
                              fmt::join(request.layers, ",")));
    }
    Expected<PlanLayer> layer = make_layer(config, request.model, kInputLayer, request, false);
    return layer ? (layers.push_back(std::move(*layer)), Status()) : layer.error();
  }
  const auto entries = find_entries(request);
  if (!entries) {
    return entries.error();
  }
  for (const ModelEntry& entry : *entries) {
    config.stem.layer = entry.layer;
    config.stem.sampling_px = sampling_of(request.config.stem.sampling_px, entry);
    Expected<PlanLayer> layer = make_layer(config, entry.name, entry.layer, request, false);
    if (!layer) {
      return layer.error();
    }
    layers.push_back(std::move(*layer));
  }
  return {};
}

/// ORB on gray, and R, G, B; not where they are what is searched.
Status add_baselines(const SearchRequest& request, std::vector<PlanLayer>& layers) {
  for (const std::string model : {"gray", "input_layer"}) {
    Config config = request.config;
    config.stem.model = model;
    config.stem.layer = StemOptions().layer;
    config.stem.sampling_px = 1;
    config.stem.filter = 0;
    if (model == "gray") {
      config.features.method = "orb";
    }
    const bool is_searched = std::any_of(layers.begin(), layers.end(), [&](const PlanLayer& layer) {
      return layer.model == model && layer.config.features.method == config.features.method;
    });
    if (is_searched) {
      continue;
    }
    Expected<PlanLayer> layer = make_layer(config, model, kInputLayer, request, true);
    if (!layer) {
      return layer.error();
    }
    layer->is_baseline = true;
    layers.push_back(std::move(*layer));
  }
  return {};
}

}  // namespace

Expected<std::vector<PlanLayer>> plan_layers(const SearchRequest& request) {
  std::vector<PlanLayer> layers;
  Status status = add_model(request, layers);
  if (status && request.baselines) {
    status = add_baselines(request, layers);
  }
  if (!status) {
    return status.error();
  }
  for (std::size_t i = 0; i < layers.size(); ++i) {  // gray and R, G, B take no pass: one for all
    const bool goes_on = i > 0 && is_input(layers[i].model) && is_input(layers[i - 1].model);
    layers[i].pass = goes_on ? layers[i - 1].pass : i;
  }
  return layers;
}

}  // namespace stemvo::search
