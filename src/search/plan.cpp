// SPDX-License-Identifier: MIT
#include <algorithm>
#include <filesystem>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "options/visit.hpp"
#include "robustness/disturbance.hpp"
#include "search/input_hashes.hpp"
#include "search/race.hpp"
#include "stem/hand_made.hpp"
#include "stem/model.hpp"

namespace stemvo::search {
namespace {

/// Name in tables of the layer of a channel made by hand.
constexpr const char* kInputLayer = "input";

/// 0: half the stride; shifted passes of a coarse layer cost more than more of them tell.
int sampling_of(int asked, const ModelInfo& info) {
  const bool is_halved = info.stride_px > 2 && info.stride_px % 2 == 0;
  return asked != 0 || info.native_sampling_only ? asked : info.stride_px / (is_halved ? 2 : 1);
}

/// The layer of a model, without what the loaded stem says.
Expected<LayerIdentity> layer_of(const SearchRequest& request, const std::string& model) {
  const bool is_file = model.ends_with(".onnx");
  LayerIdentity layer = {
      .model = is_file ? std::filesystem::path(model).stem().string() : model,
      .layer = kInputLayer,
      .features = std::string(options::to_string(request.config.features.method)),
      .sampling_px = request.config.stem.sampling_px,
      .stem_model = is_file ? from_anywhere(model) : model};
  if (is_hand_made(model)) {
    return layer;
  }
  return read_model_info(model).map([&](const ModelInfo& info) {
    layer.layer = info.layer;
    layer.sampling_px = sampling_of(request.config.stem.sampling_px, info);
    return layer;
  });
}

/// Error: two that records could not tell apart.
Expected<std::vector<LayerIdentity>> layers_of(const SearchRequest& request) {
  std::vector<LayerIdentity> layers;
  for (const std::string& model : request.models) {
    const auto layer = layer_of(request, model);
    if (!layer) {
      return layer.error();
    }
    if (std::ranges::any_of(
            layers, [&](const LayerIdentity& other) { return other.is_layer_of(layer->key(0)); })) {
      return fail(fmt::format("--model: expected each name once, found '{}' again", model));
    }
    layers.push_back(*layer);
  }
  return layers;
}

Status load_layer(const SearchRequest& request, LayerIdentity layer, SearchPlan& plan) {
  const Config config = config_of(request.config, layer, 0);
  Expected<Stem> stem = Stem::load_all(config.stem);
  if (!stem) {
    return stem.error();
  }
  const StemInfo& info = stem->info();
  const auto count = static_cast<std::size_t>(info.num_filters);
  const FrameRangeRequest all;
  const FrameRangeRequest asked = layer.baseline ? all : request.filters.value_or(all);
  const FrameRange filters{asked.begin, asked.end.value_or(count)};
  if (filters.begin >= filters.end || filters.end > count) {
    return fail(fmt::format("--filters: expected filters inside 0:{} of {}, found {}:{}", count,
                            layer.model, filters.begin, filters.end));
  }
  const auto hash = hash_model(layer.stem_model);
  if (!hash) {
    return hash.error();
  }
  layer.first = static_cast<int>(filters.begin);
  layer.last = static_cast<int>(filters.end);
  layer.hash = *hash;
  layer.sampling_px = info.sampling_px;
  plan.layers.push_back({config, std::move(*stem)});
  plan.identity.layers.push_back(std::move(layer));
  return {};
}

/// Loads the models and the baselines: ORB on gray, and R, G, B, where they are not what is
/// searched.
Status add_layers(const SearchRequest& request, SearchPlan& plan) {
  Expected<std::vector<LayerIdentity>> layers = layers_of(request);
  if (!layers) {
    return layers.error();
  }
  const std::pair<const char*, FeatureMethod> baselines[] = {
      {"gray", FeatureMethod::kOrb}, {"input_layer", request.config.features.method}};
  for (const auto& [model, method] : baselines) {
    const LayerIdentity layer = {.model = model,
                                 .layer = kInputLayer,
                                 .features = std::string(options::to_string(method)),
                                 .stem_model = model,
                                 .baseline = true};
    const auto is_it = [&](const LayerIdentity& one) { return one.is_layer_of(layer.key(0)); };
    if (request.baselines && std::ranges::none_of(*layers, is_it)) {
      layers->push_back(layer);
    }
  }
  for (const LayerIdentity& layer : *layers) {
    if (Status status = load_layer(request, layer, plan); !status) {
      return status;
    }
  }
  return {};
}

/// Checks that need no open file.
Status check_request(const SearchRequest& request) {
  if (const Status valid = validate(request.config); !valid) {
    return valid;
  }
  if (request.config.scale_choice != ScaleChoice::kGroundTruth) {
    return fail(fmt::format(
        "scale.source: expected ground_truth for a search, which ranks by t_rel with steps of the "
        "true length, found {}",
        scale_source(request.config)));
  }
  for (auto kind = request.kinds.begin(); kind != request.kinds.end(); ++kind) {
    if (robustness::find_disturbance(*kind) == nullptr ||
        std::find(request.kinds.begin(), kind, *kind) != kind) {
      return fail(fmt::format("--kinds: expected some of {}, each once, found '{}'",
                              robustness::names_of_disturbances(), *kind));
    }
  }
  if (request.only_sequence && *request.only_sequence >= num_sequences(request)) {
    return fail(fmt::format("--only-sequence: expected 0 to {}, the held-out one last, found {}",
                            num_sequences(request) - 1, *request.only_sequence));
  }
  if (request.only_sequence && !request.exhaustive) {
    return fail(
        "--only-sequence: expected --exhaustive with it (halving goes by all sequences), found "
        "none");
  }
  return {};
}

/// The candidates, which of them halving chooses from, and the rungs.
void add_race(bool exhaustive, SearchPlan& plan) {
  std::size_t num_racing = 0;
  for (std::size_t i = 0; i < plan.layers.size(); ++i) {
    const LayerIdentity& layer = plan.identity.layers[i];
    const bool races = !layer.baseline && std::ranges::all_of(plan.sequences, [i](const auto& one) {
      return one.is_held_out || one.problems[i].empty();
    });
    for (int filter = layer.first; filter < layer.last; ++filter) {
      plan.candidates.push_back({layer.key(filter), i, races});
    }
    num_racing += races ? layer.size() : 0;
  }
  plan.identity.rungs =
      exhaustive ? Schedule{{1.0, plan.identity.count(false)}} : halving_schedule(num_racing);
}

}  // namespace

Config config_of(Config common, const LayerIdentity& layer, int filter) {
  common.stem.model = layer.stem_model;
  common.stem.filter = filter;
  common.stem.sampling_px = layer.sampling_px;
  common.features.method = options::from_string<FeatureMethod>(layer.features);
  return common;
}

std::vector<std::vector<std::size_t>> cut_into_blocks(const SearchPlan& plan,
                                                      const std::vector<std::size_t>& candidates) {
  std::vector<std::vector<std::size_t>> blocks;
  for (const std::size_t candidate : candidates) {
    const std::size_t layer = plan.candidates[candidate].layer;
    const std::size_t most = plan.block > 0 ? plan.block : plan.layers[layer].max_in_flight;
    if (blocks.empty() || blocks.back().size() >= most ||
        plan.candidates[blocks.back().front()].layer != layer) {
      blocks.emplace_back();
    }
    blocks.back().push_back(candidate);
  }
  return blocks;
}

Expected<SearchPlan> make_plan(const SearchRequest& request) {
  SearchPlan plan;
  plan.block = static_cast<std::size_t>(std::max(0, request.block));
  const Status status =
      check_request(request).and_then([&] { return add_layers(request, plan); }).and_then([&] {
        return add_sequences(request, plan);
      });
  if (!status) {
    return status.error();
  }
  const auto program = hash_program();
  if (!program) {
    return program.error();
  }
  Config common = request.config;
  common.stem.model = "default";  // the layers say which
  common.stem.filter = -1;
  common.threads = 0;  // no result depends on them
  plan.identity.program = *program;
  plan.identity.configuration = dump_config(common);
  plan.identity.only_sequence = request.only_sequence;
  add_race(request.exhaustive, plan);
  return plan;
}

}  // namespace stemvo::search
