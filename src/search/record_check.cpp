// SPDX-License-Identifier: MIT
#include "search/record_check.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "search/race.hpp"

namespace stemvo::search {
namespace {

constexpr int kMaxFilter = 1000000;
// Most rungs of a search. Lines of more sequences would be longer than kMaxRecordBytes.
constexpr std::size_t kMaxRungs = 20;
constexpr std::size_t kMaxLayers = 300;
constexpr std::size_t kMaxSequences = 300;
constexpr std::size_t kMaxFrames = 100000000;
/// Bound of every number of a score: far above what a drive on Earth has.
constexpr double kMaxNumber = 1e9;
constexpr std::size_t kMaxPoints = 1000;

bool is_number(double value) { return value >= 0.0 && value <= kMaxNumber; }

Status check_numbers(const DriveScore& score) {
  for (const auto& [name, value, max] :
       {std::tuple("t_rel_percent", score.t_rel_percent, kMaxNumber),
        std::tuple("r_rel_deg_per_100m", score.r_rel_deg_per_100m, kMaxNumber),
        std::tuple("average_offset_m", score.average_offset_m, kMaxNumber),
        std::tuple("E_t_m", score.E_t_m, kMaxNumber), std::tuple("E_r_deg", score.E_r_deg, 180.0),
        std::tuple("inliers", score.inliers, kMaxNumber), std::tuple("tracked", score.tracked, 1.0),
        std::tuple("early_error_percent", score.early_error_percent, kMaxNumber)}) {
    if (value && !(*value >= 0.0 && *value <= max)) {
      return fail(fmt::format("{}: expected 0 to {}, found {}", name, max, *value));
    }
  }
  if (score.dense_t_percent.size() > kMaxPoints || score.path_xz_m.size() > kMaxPoints ||
      !std::ranges::all_of(score.dense_t_percent, is_number)) {
    return fail(fmt::format("dense_t_percent, path_xz_m: expected at most {} numbers of 0 to {}",
                            kMaxPoints, kMaxNumber));
  }
  const bool is_path = std::ranges::all_of(score.path_xz_m, [](const auto& point) {
    return is_number(std::abs(point[0])) && is_number(std::abs(point[1]));
  });
  if (!is_path || score.block < 1 || score.block > kMaxPoints) {
    return fail(is_path ? fmt::format("block: expected 1 to {}, found {}", kMaxPoints, score.block)
                        : "path_xz_m: expected metres");
  }
  return {};
}

/// The numbers that a drive has, and those that go with them.
Status check_shape(const DriveScore& score, bool is_whole) {
  const bool has_run = score.frames > 0;
  if (score.tracked.has_value() != has_run || score.inliers.has_value() != has_run) {
    return fail("tracked, inliers: expected of a drive with frames, and only there");
  }
  const double tracked = score.tracked.value_or(0.0);
  const bool is_detected = has_run && (score.frames == 1 || tracked >= DriveScore::kMinTracked);
  if (score.detected != is_detected || score.reason.empty() != is_detected) {
    return fail(
        fmt::format("detected, reason: expected what tracked, {}, says, found another", tracked));
  }
  const bool is_measured = tracked > 0.0;
  const bool has_errors = score.average_offset_m && score.E_t_m && score.E_r_deg &&
                          score.early_error_percent && !score.path_xz_m.empty();
  const bool has_any = score.average_offset_m || score.E_t_m || score.E_r_deg ||
                       score.early_error_percent || !score.path_xz_m.empty() ||
                       score.t_rel_percent || score.r_rel_deg_per_100m;
  if (has_errors != is_measured || has_any != is_measured) {
    return fail("expected errors and a path where motion was measured, and only there");
  }
  // Where a segment of the metrics fits, the shorter ones of the dense errors do.
  const bool may_be_dense = is_measured && is_whole;
  if (score.dense_t_percent.empty() ? may_be_dense && score.t_rel_percent : !may_be_dense) {
    return fail("dense_t_percent: expected of a drive over all frames, and only there");
  }
  return {};
}

Status check_score(const DriveScore& score, const SequenceIdentity& sequence, const Rung& rung) {
  if (score.sequence != sequence.name) {
    return fail(
        fmt::format("expected a drive of {}, found one of {}", sequence.name, score.sequence));
  }
  const std::size_t num_frames = frames_at(rung, sequence.num_frames);
  if (score.frames > 0 && score.frames != num_frames) {
    return fail(
        fmt::format("{}: expected {} frames, found {}", sequence.name, num_frames, score.frames));
  }
  const Status status = check_numbers(score);
  return status ? check_shape(score, num_frames == sequence.num_frames) : status;
}

/// Sequences that a record of this rung tells of.
std::vector<SequenceIdentity> sequences_of(const SearchIdentity& identity, bool is_last_rung) {
  std::vector<SequenceIdentity> sequences;
  std::set<std::string> names;
  for (std::size_t i = 0; i < identity.sequences.size(); ++i) {
    const SequenceIdentity& one = identity.sequences[i];
    if (identity.only_sequence.value_or(i) == i && (is_last_rung || !one.held_out)) {
      sequences.push_back(one);
    }
  }
  return sequences;
}

}  // namespace

Status check_identity(const SearchIdentity& identity) {
  if (identity.rungs.empty() || identity.layers.empty() || identity.sequences.empty()) {
    return fail("expected rungs, layers and sequences, found none");
  }
  for (const auto& [name, size, max] :
       {std::tuple("rungs", identity.rungs.size(), kMaxRungs),
        std::tuple("layers", identity.layers.size(), kMaxLayers),
        std::tuple("sequences", identity.sequences.size(), kMaxSequences)}) {
    if (size > max) {
      return fail(fmt::format("{}: expected at most {}, found {}", name, max, size));
    }
  }
  for (const Rung& rung : identity.rungs) {
    if (!(rung.frame_share > 0.0) || !(rung.frame_share <= 1.0)) {
      return fail(fmt::format("frame_share: expected 0 to 1, found {}", rung.frame_share));
    }
  }
  for (const LayerIdentity& layer : identity.layers) {
    if (layer.first < 0 || layer.last <= layer.first || layer.last > kMaxFilter) {
      return fail(fmt::format("layer {}: expected filters inside 0:{}, found {}:{}", layer.layer,
                              kMaxFilter, layer.first, layer.last));
    }
    const auto overlaps = [&](const LayerIdentity& one) {
      return one.is_layer_of(layer.key(0)) && one.first < layer.last && layer.first < one.last;
    };
    if (std::ranges::count_if(identity.layers, overlaps) > 1) {  // itself
      return fail(fmt::format("expected filters of {} {} once, found them again", layer.model,
                              layer.layer));
    }
  }
  std::set<std::string> names;
  for (std::size_t i = 0; i < identity.sequences.size(); ++i) {
    const SequenceIdentity& one = identity.sequences[i];
    const bool is_last = i + 1 == identity.sequences.size();
    const bool is_new = one.held_out || names.insert(one.name).second;
    if (one.num_frames > kMaxFrames || one.first_frame > kMaxFrames || (one.held_out && !is_last) ||
        !one.name.ends_with(one.disturbance) || !is_new) {
      return fail(fmt::format("{}: expected a sequence that a search has", one.name));
    }
  }
  if (identity.sequences.front().held_out) {
    return fail("expected a sequence that ranks, found none");
  }
  if (identity.only_sequence.value_or(0) >= identity.sequences.size()) {
    return fail(fmt::format("only_sequence: expected one of {}, found {}",
                            identity.sequences.size(), *identity.only_sequence));
  }
  return {};
}

Status check_record(const FilterRecord& record, const SearchIdentity& identity) {
  const auto layer = std::ranges::find_if(identity.layers, [&](const LayerIdentity& one) {
    return one.first <= record.key.filter && record.key.filter < one.last &&
           one.is_layer_of(record.key);
  });
  if (layer == identity.layers.end()) {
    return fail(fmt::format("expected a filter of the search, found {}", to_string(record.key)));
  }
  if (record.rung >= identity.rungs.size()) {
    return fail(
        fmt::format("expected a rung below {}, found {}", identity.rungs.size(), record.rung));
  }
  const bool is_last_rung = record.rung + 1 == identity.rungs.size();
  if (layer->baseline && !is_last_rung) {
    return fail(fmt::format("expected a baseline on the last rung, found rung {}", record.rung));
  }
  const auto sequences = sequences_of(identity, is_last_rung);
  std::vector<DriveScore> drives = record.drives;
  if (record.held_out) {
    drives.push_back(*record.held_out);
  }
  if (drives.empty() || drives.size() != sequences.size() ||
      record.held_out.has_value() != sequences.back().held_out) {
    return fail(fmt::format("expected drives over {} sequences, found {}", sequences.size(),
                            drives.size()));
  }
  std::size_t num_frames = 0;
  for (std::size_t i = 0; i < drives.size(); ++i) {
    if (Status status = check_score(drives[i], sequences[i], identity.rungs[record.rung]);
        !status) {
      return status;
    }
    num_frames += drives[i].frames;
  }
  if (record.filter_frames + record.held_out_filter_frames > num_frames) {
    return fail(fmt::format("filter_frames: expected at most {} of these drives, found {}",
                            num_frames, record.filter_frames + record.held_out_filter_frames));
  }
  return {};
}

}  // namespace stemvo::search
