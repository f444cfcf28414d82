// SPDX-License-Identifier: MIT
#include "search/record_check.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace stemvo::search {
namespace {

constexpr int kMaxFilter = 1000000;
constexpr std::size_t kMaxFrames = 100000000;
/// Of every number of a score: far above what a drive on Earth has.
constexpr double kMaxNumber = 1e9;
constexpr std::size_t kMaxPoints = 1000;

bool is_number(double value) { return value >= 0.0 && value <= kMaxNumber; }

Status check_numbers(const DriveScore& score) {
  for (const auto& [name, value] :
       {std::pair("t_rel_percent", score.t_rel_percent),
        std::pair("r_rel_deg_per_100m", score.r_rel_deg_per_100m),
        std::pair("average_offset_m", score.average_offset_m), std::pair("E_t_m", score.E_t_m),
        std::pair("E_r_deg", score.E_r_deg), std::pair("inliers", score.inliers),
        std::pair("tracked", score.tracked),
        std::pair("early_error_percent", score.early_error_percent)}) {
    if (value && !is_number(*value)) {
      return fail(fmt::format("{}: expected 0 to {}, found {}", name, kMaxNumber, *value));
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

Status check_score(const DriveScore& score, const SequenceIdentity& sequence) {
  if (score.sequence != sequence.name) {
    return fail(
        fmt::format("expected a drive of {}, found one of {}", sequence.name, score.sequence));
  }
  if (score.frames > sequence.num_frames) {
    return fail(fmt::format("{}: expected at most {} frames, found {}", sequence.name,
                            sequence.num_frames, score.frames));
  }
  return check_numbers(score);
}

/// Those that a record of this rung tells of.
std::vector<SequenceIdentity> sequences_of(const SearchIdentity& identity, bool is_last_rung) {
  std::vector<SequenceIdentity> sequences;
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
  }
  for (std::size_t i = 0; i < identity.sequences.size(); ++i) {
    const SequenceIdentity& one = identity.sequences[i];
    const bool is_last = i + 1 == identity.sequences.size();
    if (one.num_frames > kMaxFrames || one.first_frame > kMaxFrames || (one.held_out && !is_last) ||
        !one.name.ends_with(one.disturbance)) {
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
  const bool is_known = std::ranges::any_of(identity.layers, [&](const LayerIdentity& layer) {
    return layer.is_layer_of(record.key) && layer.first <= record.key.filter &&
           record.key.filter < layer.last;
  });
  if (!is_known) {
    return fail(fmt::format("expected a filter of the search, found {}", to_string(record.key)));
  }
  if (record.rung >= identity.rungs.size()) {
    return fail(
        fmt::format("expected a rung below {}, found {}", identity.rungs.size(), record.rung));
  }
  const auto sequences = sequences_of(identity, record.rung + 1 == identity.rungs.size());
  std::vector<DriveScore> drives = record.drives;
  if (record.held_out) {
    drives.push_back(*record.held_out);
  }
  if (drives.empty() || drives.size() != sequences.size() ||
      record.held_out.has_value() != sequences.back().held_out) {
    return fail(fmt::format("expected drives over {} sequences, found {}", sequences.size(),
                            drives.size()));
  }
  for (std::size_t i = 0; i < drives.size(); ++i) {
    if (Status status = check_score(drives[i], sequences[i]); !status) {
      return status;
    }
  }
  return {};
}

}  // namespace stemvo::search
