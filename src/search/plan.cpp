// SPDX-License-Identifier: MIT
#include "search/plan.hpp"

#include <algorithm>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "benchmark/fingerprint.hpp"
#include "stemvo/evaluation/metrics.hpp"
#include "stemvo/stem/manifest.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;

/// A channel needs room for the windows of a tracker or descriptor and for motion.
constexpr int kLeastSide_px = 16;
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
    return tl::unexpected(stem.error());
  }
  Expected<FrameRange> filters = filters_of(request, stem->info());
  if (all_filters) {
    filters = FrameRange{0, static_cast<std::size_t>(stem->info().num_filters)};
  }
  if (!filters) {
    return tl::unexpected(filters.error());
  }
  return PlanLayer{model,
                   layer,
                   std::move(config),
                   std::move(*stem),
                   static_cast<int>(filters->begin),
                   static_cast<int>(filters->end)};
}

/// Those of the model, without the baselines.
Status add_model(const SearchRequest& request, SearchPlan& plan) {
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
    return layer ? (plan.layers.push_back(std::move(*layer)), Status())
                 : tl::unexpected(layer.error());
  }
  const auto entries = find_entries(request);
  if (!entries) {
    return tl::unexpected(entries.error());
  }
  for (const ModelEntry& entry : *entries) {
    config.stem.layer = entry.layer;
    config.stem.sampling_px = sampling_of(request.config.stem.sampling_px, entry);
    Expected<PlanLayer> layer = make_layer(config, entry.name, entry.layer, request, false);
    if (!layer) {
      return tl::unexpected(layer.error());
    }
    plan.layers.push_back(std::move(*layer));
  }
  return {};
}

/// ORB on gray, and R, G, B; not where they are what is searched.
Status add_baselines(const SearchRequest& request, SearchPlan& plan) {
  for (const std::string model : {"gray", "input_layer"}) {
    Config config = request.config;
    config.stem.model = model;
    config.stem.layer = StemOptions().layer;
    config.stem.sampling_px = 1;
    config.stem.filter = 0;
    if (model == "gray") {
      config.features.method = "orb";
    }
    const bool is_searched =
        std::any_of(plan.layers.begin(), plan.layers.end(), [&](const PlanLayer& layer) {
          return layer.model == model && layer.config.features.method == config.features.method;
        });
    if (is_searched) {
      continue;
    }
    Expected<PlanLayer> layer = make_layer(config, model, kInputLayer, request, true);
    if (!layer) {
      return tl::unexpected(layer.error());
    }
    plan.layers.push_back(std::move(*layer));
  }
  return {};
}

Expected<KittiSequence> open_sequence(const SearchRequest& request,
                                      const fs::path& directory,
                                      bool is_held_out) {
  Expected<KittiSequence> sequence = KittiSequence::open(
      directory, {.camera = request.config.input.camera,
                  .frames = is_held_out ? request.held_out_frames : request.frames});
  if (!sequence) {
    return sequence;
  }
  if (!sequence->ground_truth()) {
    const fs::path file = directory / "../../poses" / (sequence->name() + ".txt");
    return fail(fmt::format("{}: expected a pose file, by which filters are ranked, found none",
                            file.lexically_normal().string()));
  }
  const Trajectory& truth = *sequence->ground_truth();
  const Metrics metrics = evaluate(truth, truth, request.config.evaluation);
  if (metrics.num_segments == 0) {
    return fail(fmt::format(
        "{}: expected a path that holds a segment of {} m, by which filters are ranked, found "
        "{:.1f} m in {} frames",
        directory.string(),
        metrics.segment_lengths_m.empty() ? 0.0 : metrics.segment_lengths_m.front(),
        metrics.path_length_m, sequence->size()));
  }
  return sequence;
}

std::string unusable_reason(const PlanLayer& layer, const Camera& camera) {
  const cv::Mat blank(camera.height_px, camera.width_px, CV_8UC1, cv::Scalar(0));
  const auto channels = layer.stem.apply_range(blank, layer.first, layer.first + 1);
  if (!channels) {
    return channels.error().message;
  }
  const cv::Size size = channels->front().values.size();
  return std::min(size.width, size.height) < kLeastSide_px
             ? fmt::format("channel {}x{}", size.width, size.height)
             : std::string();
}

Status add_sequence(const SearchRequest& request,
                    const fs::path& directory,
                    bool is_held_out,
                    SearchPlan& plan) {
  Expected<KittiSequence> sequence = open_sequence(request, directory, is_held_out);
  if (!sequence) {
    return tl::unexpected(sequence.error());
  }
  const FrameRange range = sequence->range();
  SequenceIdentity identity;
  identity.name = sequence->name();
  identity.is_held_out = is_held_out;
  identity.first_frame = range.begin;
  identity.num_frames = sequence->size();
  std::error_code ignored;
  identity.directory = fs::absolute(directory, ignored).lexically_normal().string();
  for (std::size_t i = 0; i < plan.layers.size(); ++i) {
    const auto hashes = benchmark::make_fingerprint(plan.layers[i].config, *sequence, directory,
                                                    request.models_dir);
    if (!hashes) {
      return tl::unexpected(hashes.error());
    }
    plan.identity.program = hashes->program;
    plan.identity.layers[i].hash = hashes->model;
    identity.frames = hashes->frames;
    identity.calibration = hashes->calibration;
    identity.ground_truth = hashes->ground_truth;
  }
  plan.identity.sequences.push_back(std::move(identity));
  PlanSequence planned{std::move(*sequence), is_held_out, {}};
  for (const PlanLayer& layer : plan.layers) {
    planned.unusable.push_back(unusable_reason(layer, planned.sequence.camera()));
  }
  plan.sequences.push_back(std::move(planned));
  return {};
}

void add_candidates(SearchPlan& plan) {
  for (std::size_t i = 0; i < plan.layers.size(); ++i) {
    const PlanLayer& layer = plan.layers[i];
    const std::string& features = layer.config.features.method;
    plan.identity.layers.push_back({.model = layer.model,
                                    .layer = layer.layer,
                                    .features = features,
                                    .first = layer.first,
                                    .last = layer.last,
                                    .hash = {},
                                    .sampling_px = layer.stem.info().sampling_px,
                                    .stem_model = layer.config.stem.model});
    for (int filter = layer.first; filter < layer.last; ++filter) {
      plan.candidates.push_back({{layer.model, layer.layer, filter, features}, i});
    }
  }
}

Status check_request(const SearchRequest& request) {
  if (const Status valid = validate(request.config); !valid) {
    return valid;
  }
  if (request.config.scale.source != "ground_truth") {
    return fail(fmt::format(
        "scale.source: expected ground_truth for a search, which ranks by t_rel with steps of the "
        "true length, found {}",
        request.config.scale.source));
  }
  return {};
}

}  // namespace

std::size_t SearchPlan::num_frames(bool held_out) const {
  std::size_t count = 0;
  for (const PlanSequence& one : sequences) {
    count += one.is_held_out == held_out ? one.sequence.size() : 0;
  }
  return count;
}

Expected<SearchPlan> make_plan(const SearchRequest& request) {
  Status status = check_request(request);
  SearchPlan plan;
  if (status) {
    status = add_model(request, plan);
  }
  if (status && request.baselines) {
    status = add_baselines(request, plan);
  }
  if (!status) {
    return tl::unexpected(status.error());
  }
  add_candidates(plan);
  for (const fs::path& directory : request.sequence_dirs) {
    if (status) {
      status = add_sequence(request, directory, false, plan);
    }
  }
  if (status && request.held_out_dir) {
    status = add_sequence(request, *request.held_out_dir, true, plan);
  }
  if (!status) {
    return tl::unexpected(status.error());
  }
  Config common = request.config;
  common.stem.model = "default";  // the layers say which
  common.stem.layer = StemOptions().layer;
  common.stem.filter = -1;
  plan.identity.configuration = dump_config(common);
  plan.identity.schedule = request.exhaustive ? exhaustive_schedule(plan.candidates.size())
                                              : halving_schedule(plan.candidates.size());
  return plan;
}

}  // namespace stemvo::search
