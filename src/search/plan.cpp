// SPDX-License-Identifier: MIT
#include <algorithm>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "evaluation/metrics.hpp"
#include "models/manifest.hpp"
#include "options/option_fields.hpp"
#include "pipeline/input_hashes.hpp"
#include "robustness/disturbance.hpp"
#include "search/race.hpp"
#include "stem/hand_made.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;

/// A channel needs room for the windows of a tracker or descriptor and for motion.
constexpr int kMinSide_px = 16;

/// What the filters in flight may take by the estimate; the process takes some 0.2 GB more, and the
/// weights and layers of the network.
constexpr std::size_t kBlockBytes = std::size_t{1} << 30;

/// Of three.
constexpr std::size_t kMiddleStrength = 1;

/// What the layer of a channel made by hand is called in tables.
constexpr const char* kInputLayer = "input";

/// 0: half the stride; shifted passes of a coarse layer cost more than more of them tell.
int sampling_of(int asked, const ModelEntry& entry) {
  const bool is_halved = entry.stride_px > 2 && entry.stride_px % 2 == 0;
  return asked != 0 || entry.native_sampling_only ? asked : entry.stride_px / (is_halved ? 2 : 1);
}

/// Found from any folder later on.
std::string from_anywhere(const fs::path& path) {
  std::error_code ignored;
  return fs::absolute(path, ignored).lexically_normal().string();
}

/// The model's layers, or those asked for in that order; without what the loaded stem says.
Expected<std::vector<LayerIdentity>> model_layers(const SearchRequest& request) {
  const std::string& model = request.model;
  LayerIdentity layer = {
      .model = model,
      .layer = kInputLayer,
      .features = std::string(options::to_string(request.config.features.method)),
      .sampling_px = request.config.stem.sampling_px,
      .stem_model = model.ends_with(".onnx") ? from_anywhere(model) : model};
  if (is_hand_made(model)) {
    if (!request.layers.empty()) {
      return fail(fmt::format("--layers: expected none for {}, found '{}'", model,
                              fmt::join(request.layers, ",")));
    }
    return std::vector{layer};
  }
  const auto entries = find_layers(model, request.models_dir);
  if (!entries) {
    return entries.error();
  }
  std::vector<std::string> names(entries->size());
  std::ranges::transform(*entries, names.begin(), &ModelEntry::layer);
  std::vector<LayerIdentity> chosen;
  for (const std::string& name : request.layers.empty() ? names : request.layers) {
    const auto entry = std::ranges::find(*entries, name, &ModelEntry::layer);
    if (entry == entries->end()) {
      return fail(fmt::format("--layers: {}: expected one of {}, found '{}'", model,
                              fmt::join(names, ", "), name));
    }
    layer.model = entry->name;
    layer.layer = name;
    layer.sampling_px = sampling_of(request.config.stem.sampling_px, *entry);
    chosen.push_back(layer);
  }
  return chosen;
}

Status load_layer(const SearchRequest& request, LayerIdentity layer, SearchPlan& plan) {
  const Config config = config_of(request.config, layer, 0);
  Expected<Stem> stem = create_stem(config.stem, request.models_dir);
  if (!stem) {
    return stem.error();
  }
  const StemInfo& info = stem->info();
  const auto count = static_cast<std::size_t>(info.num_filters);
  const FrameRangeRequest all;
  const FrameRangeRequest asked = layer.baseline ? all : request.filters.value_or(all);
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
  // Gray and R, G, B take no pass: one for all.
  const std::size_t pass = is_hand_made(layer.model) ? SIZE_MAX : plan.layers.size();
  plan.layers.push_back({config, std::move(*stem), pass});
  plan.identity.layers.push_back(std::move(layer));
  return {};
}

/// Loads the model's layers, those asked for, and the baselines: ORB on gray, and R, G, B, where
/// they are not what is searched.
Status add_layers(const SearchRequest& request, SearchPlan& plan) {
  Expected<std::vector<LayerIdentity>> layers = model_layers(request);
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

std::size_t num_sequences(const SearchRequest& request) {
  return request.sequence_dirs.size() * (1 + request.kinds.size()) + (request.held_out_dir ? 1 : 0);
}

/// What can be said before anything is opened.
Status check_request(const SearchRequest& request) {
  if (const Status valid = validate(request.config); !valid) {
    return valid;
  }
  if (request.config.scale.source != ScaleSource::kGroundTruth) {
    return fail(fmt::format(
        "scale.source: expected ground_truth for a search, which ranks by t_rel with steps of the "
        "true length, found {}",
        options::to_string(request.config.scale.source)));
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
  for (auto layer = request.layers.begin(); layer != request.layers.end(); ++layer) {
    if (std::find(request.layers.begin(), layer, *layer) != layer) {
      return fail(fmt::format("--layers: expected each once, found '{}' again", *layer));
    }
  }
  return {};
}

/// Each sequence ranks once, under a name of its own, and the held-out one has no frame that ranks.
Status check_pair(const SequenceIdentity& before, const SequenceIdentity& added) {
  std::error_code code;
  const bool same_folder = before.disturbance == added.disturbance &&
                           (before.directory == added.directory ||
                            fs::equivalent(before.directory, added.directory, code));
  const std::size_t begin = std::max(before.first_frame, added.first_frame);
  const std::size_t end = std::min(before.end_frame(), added.end_frame());
  if (added.held_out && same_folder && begin < end) {
    return fail(
        fmt::format("--held-out: {}: expected frames that do not rank, found {}:{}, of which {}:{} "
                    "do (--held-out-frames, --frames)",
                    added.directory, added.first_frame, added.end_frame(), begin, end));
  }
  if (!added.held_out && (same_folder || before.name == added.name)) {
    return fail(fmt::format("SEQUENCE_DIR: expected each {} once, found {} and {}",
                            same_folder ? "folder" : "name, by which sequences are told apart,",
                            before.directory, added.directory));
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
    return fail(file.lexically_normal().string() +
                ": expected a pose file, by which filters are ranked, found none");
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

/// Why the layer's filters cannot be run on frames of this camera, empty where they can; lowers how
/// many are in flight.
std::string fit_layer(const SearchRequest& request,
                      const LayerIdentity& identity,
                      const Camera& camera,
                      PlanLayer& layer) {
  const cv::Mat blank(camera.height_px, camera.width_px, CV_8UC1, cv::Scalar(0));
  const auto channels = layer.stem.apply_range(blank, identity.first, identity.first + 1);
  if (!channels) {
    return channels.error().message;
  }
  const cv::Size size = channels->front().values.size();
  const Upsample upsample =
      choose_upsample(layer.config.stem.upsample, layer.config.features.method, camera);
  const double factor =
      static_cast<double>(identity.sampling_px) / image_sampling_px(upsample, identity.sampling_px);
  const std::size_t num_run = request.only_sequence ? 1 : num_sequences(request);
  const std::size_t bytes = bytes_in_flight(size, cv::Size2d(size) * factor, num_run);
  layer.max_in_flight = std::clamp<std::size_t>(kBlockBytes / bytes, 1, layer.max_in_flight);
  const bool is_small = std::min(size.width, size.height) < kMinSide_px;
  return is_small ? fmt::format("channel {}x{}", size.width, size.height) : std::string();
}

/// "_dusk_0.03": the end of a disturbed sequence's name; empty: as the frames are.
std::string suffix_of(const robustness::Disturbance* how) {
  return how == nullptr ? "" : fmt::format("_{}_{}", how->name, how->strengths[kMiddleStrength]);
}

/// The frames under it, null: as they are.
FrameSource disturbed(const FrameSource& source,
                      const robustness::Disturbance* how,
                      std::uint64_t seed) {
  FrameList frames =
      (how == nullptr ? source : robustness::disturb(source, *how, kMiddleStrength, seed)).frames();
  frames.name += suffix_of(how);
  return FrameSource(std::move(frames));
}

/// `kind`: of a disturbance, empty: as the frames are.
Status add_sequence(const SearchRequest& request,
                    const fs::path& directory,
                    bool is_held_out,
                    const std::string& kind,
                    SearchPlan& plan) {
  Expected<KittiSequence> sequence = open_sequence(request, directory, is_held_out);
  if (!sequence) {
    return sequence.error();
  }
  std::vector<SequenceIdentity>& known = plan.identity.sequences;
  const bool is_run = request.only_sequence.value_or(known.size()) == known.size();
  using pipeline::FrameIdentity;
  const auto hashes = pipeline::hash_sequence(
      *sequence, directory, is_run ? FrameIdentity::kContents : FrameIdentity::kNamesAndSizes);
  if (!hashes) {
    return hashes.error();
  }
  const robustness::Disturbance* const how = robustness::find_disturbance(kind);
  const FrameSource source = disturbed(*sequence, how, request.config.seed);
  const SequenceIdentity added = {.name = source.name(),
                                  .held_out = is_held_out,
                                  .disturbance = suffix_of(how),
                                  .first_frame = sequence->range().begin,
                                  .num_frames = source.size(),
                                  .frames = is_run ? hashes->frames : std::string(),
                                  .calibration = hashes->calibration,
                                  .ground_truth = hashes->ground_truth,
                                  .directory = from_anywhere(directory)};
  for (const SequenceIdentity& before : known) {
    if (Status status = check_pair(before, added); !status) {
      return status;
    }
  }
  known.push_back(added);
  if (!is_run) {
    return {};
  }
  std::vector<std::string> problems;
  for (std::size_t i = 0; i < plan.layers.size(); ++i) {
    problems.push_back(
        fit_layer(request, plan.identity.layers[i], source.camera(), plan.layers[i]));
  }
  plan.sequences.push_back({source, sequence->name(), is_held_out, std::move(problems)});
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
  common.stem.layer = is_hand_made(layer.model) ? StemOptions().layer : layer.layer;
  common.stem.filter = filter;
  common.stem.sampling_px = layer.sampling_px;
  common.features.method = options::feature_method(layer.features);
  return common;
}

std::size_t bytes_in_flight(cv::Size channel, cv::Size image, std::size_t num_sequences) {
  const auto channel_px = static_cast<std::size_t>(channel.area());
  const auto image_px = static_cast<std::size_t>(image.area());
  constexpr std::size_t kPathBytes = std::size_t{1} << 17;
  // A gray value and two derivatives of 16 bits on each level of the pyramid, 4/3 of the first
  // one's pixels in all; the image itself; what a thread works in.
  const std::size_t bytes_per_px = 8 + (image == channel ? 0 : sizeof(float));
  return 2 * sizeof(float) * channel_px + num_sequences * (bytes_per_px * image_px + kPathBytes);
}

std::vector<std::vector<std::size_t>> cut_into_blocks(const SearchPlan& plan,
                                                      const std::vector<std::size_t>& candidates) {
  std::vector<std::vector<std::size_t>> blocks;
  const PlanLayer* first = nullptr;  // of the last block
  for (const std::size_t candidate : candidates) {
    const PlanLayer& layer = plan.layers[plan.candidates[candidate].layer];
    const bool goes_on =
        first != nullptr && (plan.block > 0 || layer.pass == first->pass) &&
        blocks.back().size() < (plan.block > 0 ? plan.block : first->max_in_flight);
    if (!goes_on) {
      blocks.emplace_back();
      first = &layer;
    }
    blocks.back().push_back(candidate);
  }
  return blocks;
}

Expected<SearchPlan> make_plan(const SearchRequest& request) {
  SearchPlan plan;
  plan.block = static_cast<std::size_t>(std::max(0, request.block));
  Status status = check_request(request).and_then([&] { return add_layers(request, plan); });
  std::vector<std::string> kinds = {""};  // first as they are: the sheet shows the first of all
  kinds.insert(kinds.end(), request.kinds.begin(), request.kinds.end());
  for (const std::string& kind : kinds) {
    for (const fs::path& directory : request.sequence_dirs) {
      status = status ? add_sequence(request, directory, false, kind, plan) : status;
    }
  }
  if (status && request.held_out_dir) {
    status = add_sequence(request, *request.held_out_dir, true, "", plan);
  }
  if (!status) {
    return status.error();
  }
  const auto program = pipeline::hash_program();
  if (!program) {
    return program.error();
  }
  Config common = request.config;
  common.stem.model = "default";  // the layers say which
  common.stem.layer = StemOptions().layer;
  common.stem.filter = -1;
  plan.identity.program = *program;
  plan.identity.configuration = dump_config(common);
  plan.identity.only_sequence = request.only_sequence;
  add_race(request.exhaustive, plan);
  return plan;
}

}  // namespace stemvo::search
