// SPDX-License-Identifier: MIT
#include "search/identity.hpp"

#include <algorithm>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "stemvo/check.hpp"
#include "text/text_file.hpp"

namespace stemvo::search {
namespace {

/// The first key that differs: "klt_levels: 3, now klt_levels: 4".
std::string first_difference(const std::string& before, const std::string& now) {
  const auto trimmed = [](std::string_view line) {
    const std::size_t begin = line.find_first_not_of(' ');
    const std::string_view text = begin == line.npos ? std::string_view() : line.substr(begin);
    return std::string(text.substr(0, text.find(" #")));
  };
  const auto old_lines = split_lines(before);
  const auto new_lines = split_lines(now);
  for (std::size_t i = 0; i < std::min(old_lines.size(), new_lines.size()); ++i) {
    if (old_lines[i] != new_lines[i]) {
      return fmt::format("{}, now {}", trimmed(old_lines[i]), trimmed(new_lines[i]));
    }
  }
  return "other keys";
}

bool same_layer(const LayerIdentity& a, const LayerIdentity& b) {
  return a.model == b.model && a.layer == b.layer && a.features == b.features;
}

std::string name_of(const LayerIdentity& layer) { return layer.model + " " + layer.layer; }

std::string name_of(const std::optional<std::size_t>& only_sequence) {
  return only_sequence ? std::to_string(*only_sequence) : "not given";
}

void compare_layers(const SearchIdentity& before,
                    const SearchIdentity& now,
                    bool as_parts,
                    std::vector<std::string>& changed) {
  for (const LayerIdentity& layer : now.layers) {
    const auto other =
        std::find_if(before.layers.begin(), before.layers.end(),
                     [&](const LayerIdentity& candidate) { return same_layer(candidate, layer); });
    if (other == before.layers.end()) {
      if (!as_parts) {
        changed.push_back(fmt::format("the layers (now also {})", name_of(layer)));
      }
    } else if (other->hash != layer.hash) {
      changed.push_back(fmt::format("the model {}", name_of(layer)));
    } else if (other->sampling_px != layer.sampling_px) {
      changed.push_back(fmt::format("the sampling of {} ({} px, now {} px)", name_of(layer),
                                    other->sampling_px, layer.sampling_px));
    } else if (!as_parts && (other->first != layer.first || other->last != layer.last)) {
      changed.push_back(fmt::format("the filters of {} ({}:{}, now {}:{})", name_of(layer),
                                    other->first, other->last, layer.first, layer.last));
    }
  }
  if (!as_parts && before.layers.size() > now.layers.size()) {
    changed.emplace_back("the layers (fewer now)");
  }
}

bool same_frames(const SequenceIdentity& a, const SequenceIdentity& b, bool as_parts) {
  return a.frames == b.frames || (as_parts && (a.frames.empty() || b.frames.empty()));
}

void compare_sequences(const SearchIdentity& before,
                       const SearchIdentity& now,
                       bool as_parts,
                       std::vector<std::string>& changed) {
  if (before.sequences.size() != now.sequences.size()) {
    changed.push_back(
        fmt::format("the sequences ({}, now {})", before.sequences.size(), now.sequences.size()));
    return;
  }
  for (std::size_t i = 0; i < now.sequences.size(); ++i) {
    const SequenceIdentity& a = before.sequences[i];
    const SequenceIdentity& b = now.sequences[i];
    if (a.name != b.name || a.is_held_out != b.is_held_out) {
      changed.push_back(fmt::format("the sequence {}, now {},", a.name, b.name));
    } else if (a.first_frame != b.first_frame || a.num_frames != b.num_frames) {
      changed.push_back(fmt::format("the frames of {} ({}:{}, now {}:{})", a.name, a.first_frame,
                                    a.first_frame + a.num_frames, b.first_frame,
                                    b.first_frame + b.num_frames));
    } else if (!same_frames(a, b, as_parts)) {
      changed.push_back(fmt::format("the frames of {}", a.name));
    } else if (a.calibration != b.calibration) {
      changed.push_back(fmt::format("calib.txt or times.txt of {}", a.name));
    } else if (a.ground_truth != b.ground_truth) {
      changed.push_back(fmt::format("the pose file of {}", a.name));
    }
  }
}

}  // namespace

std::size_t num_filters(const SearchIdentity& identity) {
  std::size_t count = 0;
  for (const LayerIdentity& layer : identity.layers) {
    count += static_cast<std::size_t>(layer.last - layer.first);
  }
  return count;
}

std::size_t num_baselines(const SearchIdentity& identity) {
  std::size_t count = 0;
  for (const LayerIdentity& layer : identity.layers) {
    count += layer.is_baseline ? static_cast<std::size_t>(layer.last - layer.first) : 0;
  }
  return count;
}

const LayerIdentity& layer_of(const SearchIdentity& identity, const FilterKey& key) {
  const auto layer = std::find_if(
      identity.layers.begin(), identity.layers.end(), [&key](const LayerIdentity& one) {
        return one.model == key.model && one.layer == key.layer && one.features == key.features &&
               one.first <= key.filter && key.filter < one.last;
      });
  STEMVO_CHECK(layer != identity.layers.end(), "each row has a layer");
  return *layer;
}

std::string describe_change(const SearchIdentity& before,
                            const SearchIdentity& now,
                            bool as_parts) {
  std::vector<std::string> changed;
  if (before.configuration != now.configuration) {
    changed.push_back(fmt::format("the configuration ({})",
                                  first_difference(before.configuration, now.configuration)));
  }
  if (before.program != now.program) {
    changed.emplace_back("the program");
  }
  compare_layers(before, now, as_parts, changed);
  if (!as_parts && before.only_sequence != now.only_sequence) {
    changed.push_back(fmt::format("--only-sequence ({}, now {})", name_of(before.only_sequence),
                                  name_of(now.only_sequence)));
  } else {
    compare_sequences(before, now, as_parts, changed);
  }
  if (!as_parts && changed.empty() && before.schedule != now.schedule) {
    changed.emplace_back(now.schedule.size() == 1 ? "--exhaustive (now given)"
                                                  : "the plan of halving or --exhaustive");
  }
  return changed.empty() ? std::string() : fmt::format("{} changed", fmt::join(changed, " and "));
}

}  // namespace stemvo::search
