// SPDX-License-Identifier: MIT
#include <algorithm>
#include <iterator>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "evaluation/metrics.hpp"
#include "robustness/disturbance.hpp"
#include "search/input_hashes.hpp"
#include "search/race.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;

/// A channel needs room for the windows of a tracker or descriptor and for motion.
constexpr int kMinSide_px = 16;

/// Memory that filters in flight may take by the estimate; the process takes some 0.2 GB more, and
/// the weights and layers of the network.
constexpr std::size_t kBlockBytes = std::size_t{1} << 30;

/// Second of three strengths.
constexpr std::size_t kMiddleStrength = 1;

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

/// A directory, read and hashed once however often it is disturbed.
struct OpenedSequence {
  fs::path directory;
  FrameSource sequence;
  bool is_held_out = false;
  SequenceHashes hashes;
};

/// `is_run`: else the contents of its frames do not matter here.
Expected<OpenedSequence> open_sequence(const SearchRequest& request,
                                       const fs::path& directory,
                                       bool is_held_out,
                                       bool is_run) {
  Expected<FrameSource> sequence =
      open_kitti(directory, {.camera = request.config.input.camera,
                             .frames = is_held_out ? request.held_out_frames : request.frames});
  if (!sequence) {
    return sequence.error();
  }
  if (!sequence->ground_truth) {
    const fs::path file = directory / "../../poses" / (sequence->name + ".txt");
    return fail(file.lexically_normal().string() +
                ": expected a pose file, by which filters are ranked, found none");
  }
  const Trajectory& truth = *sequence->ground_truth;
  const Metrics metrics = evaluate(truth, truth, request.config.evaluation);
  if (metrics.num_segments == 0) {
    return fail(fmt::format(
        "{}: expected a path that holds a segment of {} m, by which filters are ranked, found "
        "{:.1f} m in {} frames",
        directory.string(),
        metrics.segment_lengths_m.empty() ? 0.0 : metrics.segment_lengths_m.front(),
        metrics.path_length_m, sequence->size()));
  }
  return hash_sequence(*sequence, directory,
                       is_run ? FrameIdentity::kContents : FrameIdentity::kNamesAndSizes)
      .map([&](const SequenceHashes& hashes) {
        return OpenedSequence{directory, *sequence, is_held_out, hashes};
      });
}

/// Why the layer's filters cannot be run on frames of this camera, empty where they can; lowers how
/// many are in flight.
std::string fit_layer(const SearchRequest& request,
                      const LayerIdentity& identity,
                      const Camera& camera,
                      PlanLayer& layer) {
  const cv::Mat blank(camera.height_px, camera.width_px, CV_8UC1, cv::Scalar(0));
  const int zoom = frame_zoom(layer, camera);
  const auto channels = layer.stem.apply_range(blank, identity.first, identity.first + 1, zoom);
  if (!channels) {
    return channels.error().message;
  }
  const cv::Size size = channels->front().values.size();
  const TrackingResolution resolution = choose_tracking_resolution(
      layer.config.stem.tracking_resolution, layer.config.features.method, camera);
  const int sampling_px = identity.sampling_px / zoom;
  const double factor =
      static_cast<double>(sampling_px) / image_sampling_px(resolution, sampling_px);
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
  if (how == nullptr) {
    return source;
  }
  FrameSource frames = robustness::disturb(source, *how, kMiddleStrength, seed);
  frames.name += suffix_of(how);
  return frames;
}

Status add_sequence(const SearchRequest& request,
                    const OpenedSequence& opened,
                    const robustness::Disturbance* how,
                    SearchPlan& plan) {
  std::vector<SequenceIdentity>& known = plan.identity.sequences;
  const bool is_run = request.only_sequence.value_or(known.size()) == known.size();
  const FrameSource source = disturbed(opened.sequence, how, request.config.seed);
  const SequenceIdentity added = {.name = source.name,
                                  .held_out = opened.is_held_out,
                                  .disturbance = suffix_of(how),
                                  .first_frame = opened.sequence.range.begin,
                                  .num_frames = source.size(),
                                  .frames = is_run ? opened.hashes.frames : std::string(),
                                  .calibration = opened.hashes.calibration,
                                  .ground_truth = opened.hashes.ground_truth,
                                  .directory = from_anywhere(opened.directory)};
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
    problems.push_back(fit_layer(request, plan.identity.layers[i], source.camera, plan.layers[i]));
  }
  plan.sequences.push_back({source, opened.is_held_out, std::move(problems)});
  return {};
}

}  // namespace

std::string from_anywhere(const fs::path& path) {
  std::error_code ignored;
  return fs::absolute(path, ignored).lexically_normal().string();
}

std::size_t num_sequences(const SearchRequest& request) {
  return request.sequence_dirs.size() * (1 + request.kinds.size()) + (request.held_out_dir ? 1 : 0);
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

Status add_sequences(const SearchRequest& request, SearchPlan& plan) {
  const auto& only = request.only_sequence;
  const std::size_t num_folders = request.sequence_dirs.size();
  const std::size_t num_ranking = num_folders * (1 + request.kinds.size());
  std::vector<OpenedSequence> ranking;
  for (std::size_t i = 0; i < num_folders; ++i) {
    const bool is_run = !only || (*only < num_ranking && *only % num_folders == i);
    auto opened = open_sequence(request, request.sequence_dirs[i], false, is_run);
    if (!opened) {
      return opened.error();
    }
    ranking.push_back(*std::move(opened));
  }
  // First as they are: the sheet shows the first of all.
  std::vector<const robustness::Disturbance*> kinds = {nullptr};
  std::ranges::transform(request.kinds, std::back_inserter(kinds), robustness::find_disturbance);
  for (const robustness::Disturbance* const how : kinds) {
    for (const OpenedSequence& opened : ranking) {
      if (Status status = add_sequence(request, opened, how, plan); !status) {
        return status;
      }
    }
  }
  if (!request.held_out_dir) {
    return {};
  }
  return open_sequence(request, *request.held_out_dir, true,
                       only.value_or(num_ranking) == num_ranking)
      .and_then([&](const OpenedSequence& opened) {
        return add_sequence(request, opened, nullptr, plan);
      });
}

}  // namespace stemvo::search
