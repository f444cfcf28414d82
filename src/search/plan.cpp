// SPDX-License-Identifier: MIT
#include "search/plan.hpp"

#include <algorithm>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "benchmark/fingerprint.hpp"
#include "search/check_request.hpp"
#include "stemvo/evaluation/metrics.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;

/// A channel needs room for the windows of a tracker or descriptor and for motion.
constexpr int kLeastSide_px = 16;

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

/// Whether a layer's filters can be run on frames of this size.
void add_layer(const PlanLayer& layer, PlanSequence& planned) {
  const Camera& camera = planned.sequence.camera();
  const cv::Mat blank(camera.height_px, camera.width_px, CV_8UC1, cv::Scalar(0));
  const auto channels = layer.stem.apply_range(blank, layer.first, layer.first + 1);
  std::string& unusable = planned.unusable.emplace_back();
  cv::Size& size = planned.channels.emplace_back();
  if (!channels) {
    unusable = channels.error().message;
    return;
  }
  size = channels->front().values.size();
  if (std::min(size.width, size.height) < kLeastSide_px) {
    unusable = fmt::format("channel {}x{}", size.width, size.height);
  }
}

Status add_sequence(const SearchRequest& request,
                    const fs::path& directory,
                    bool is_held_out,
                    SearchPlan& plan) {
  Expected<KittiSequence> sequence = open_sequence(request, directory, is_held_out);
  if (!sequence) {
    return sequence.error();
  }
  const FrameRange range = sequence->range();
  SequenceIdentity identity;
  identity.name = sequence->name();
  identity.is_held_out = is_held_out;
  identity.first_frame = range.begin;
  identity.num_frames = sequence->size();
  std::error_code ignored;
  identity.directory = fs::absolute(directory, ignored).lexically_normal().string();
  const bool is_run = request.only_sequence.value_or(plan.identity.sequences.size()) ==
                      plan.identity.sequences.size();
  const auto hashes = benchmark::hash_sequence(
      *sequence, directory,
      is_run ? benchmark::FrameIdentity::kContents : benchmark::FrameIdentity::kNamesAndSizes);
  if (!hashes) {
    return hashes.error();
  }
  identity.frames = is_run ? hashes->frames : std::string();
  identity.calibration = hashes->calibration;
  identity.ground_truth = hashes->ground_truth;
  plan.identity.sequences.push_back(std::move(identity));
  if (!is_run) {
    return {};
  }
  PlanSequence planned{std::move(*sequence), is_held_out, {}, {}};
  for (const PlanLayer& layer : plan.layers) {
    add_layer(layer, planned);
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
                                    .stem_model = layer.config.stem.model,
                                    .is_baseline = layer.is_baseline});
    for (int filter = layer.first; filter < layer.last; ++filter) {
      plan.candidates.push_back({.key = {layer.model, layer.layer, filter, features},
                                 .layer = i,
                                 .is_baseline = layer.is_baseline});
    }
  }
}

void choose_racing(SearchPlan& plan) {
  for (Candidate& candidate : plan.candidates) {
    candidate.races =
        !candidate.is_baseline && std::all_of(plan.sequences.begin(), plan.sequences.end(),
                                              [&candidate](const PlanSequence& sequence) {
                                                return sequence.is_held_out ||
                                                       sequence.unusable[candidate.layer].empty();
                                              });
  }
}

/// Of the filters; baselines are outside.
Schedule schedule_of(const SearchPlan& plan, bool exhaustive) {
  const auto racing = std::count_if(plan.candidates.begin(), plan.candidates.end(),
                                    [](const Candidate& one) { return one.races; });
  return exhaustive ? exhaustive_schedule(num_filters(plan.identity) - num_baselines(plan.identity))
                    : halving_schedule(static_cast<std::size_t>(racing));
}

/// Those of the program and of each layer's model.
Status add_hashes(const SearchRequest& request, SearchPlan& plan) {
  const auto program = benchmark::hash_program();
  if (!program) {
    return program.error();
  }
  plan.identity.program = *program;
  for (std::size_t i = 0; i < plan.layers.size(); ++i) {
    const auto model = benchmark::hash_model(plan.layers[i].config, request.models_dir);
    if (!model) {
      return model.error();
    }
    plan.identity.layers[i].hash = *model;
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
  if (!status) {
    return status.error();
  }
  Expected<std::vector<PlanLayer>> layers = plan_layers(request);
  if (!layers) {
    return layers.error();
  }
  SearchPlan plan;
  plan.layers = std::move(*layers);
  add_candidates(plan);
  status = add_hashes(request, plan);
  for (const fs::path& directory : request.sequence_dirs) {
    if (status) {
      status = add_sequence(request, directory, false, plan);
    }
  }
  if (status && request.held_out_dir) {
    status = add_sequence(request, *request.held_out_dir, true, plan);
  }
  if (status) {
    status = check_sequences(plan.identity);
  }
  if (!status) {
    return status.error();
  }
  plan.identity.only_sequence = request.only_sequence;
  Config common = request.config;
  common.stem.model = "default";  // the layers say which
  common.stem.layer = StemOptions().layer;
  common.stem.filter = -1;
  plan.identity.configuration = dump_config(common);
  choose_racing(plan);
  plan.identity.schedule = schedule_of(plan, request.exhaustive);
  return plan;
}

}  // namespace stemvo::search
