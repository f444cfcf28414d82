// SPDX-License-Identifier: MIT
#include <algorithm>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "search/records.hpp"
#include "text/text_file.hpp"

namespace stemvo::search {
namespace {

/// The first key that differs: "klt_levels: 3, now klt_levels: 4".
std::string first_difference(const std::string& before, const std::string& now) {
  const auto old_lines = split_lines(before);
  const auto new_lines = split_lines(now);
  const auto [a, b] = std::ranges::mismatch(old_lines, new_lines);
  if (a == old_lines.end() || b == new_lines.end()) {
    return "other keys";
  }
  const auto trimmed = [](std::string_view line) {
    line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
    return line.substr(0, line.find(" #"));
  };
  return fmt::format("{}, now {}", trimmed(*a), trimmed(*b));
}

std::string range(auto first, auto last) { return fmt::format("{}:{}", first, last); }

/// What changed, in words.
struct Changes {
  std::vector<std::string> words;

  /// True where it did.
  bool note(bool has_changed, const std::string& what) {
    if (has_changed) {
      words.push_back(what);
    }
    return has_changed;
  }
  bool compare(const std::string& what, const auto& before, const auto& now) {
    return note(before != now, fmt::format("{} ({}, now {})", what, before, now));
  }
};

void compare_layer(const LayerIdentity& a,
                   const LayerIdentity& b,
                   bool as_parts,
                   Changes& changes) {
  const std::string name = b.model + " " + b.layer;
  if (changes.note(a.hash != b.hash, "the model " + name)) {
    return;
  }
  changes.compare("the sampling of " + name, fmt::format("{} px", a.sampling_px),
                  fmt::format("{} px", b.sampling_px));
  if (!as_parts) {
    changes.compare("the filters of " + name, range(a.first, a.last), range(b.first, b.last));
  }
}

void compare_sequence(const SequenceIdentity& a,
                      const SequenceIdentity& b,
                      bool as_parts,
                      Changes& changes) {
  const auto frames = [](const SequenceIdentity& one) {
    return range(one.first_frame, one.first_frame + one.num_frames);
  };
  const bool is_known = !as_parts || (!a.frames.empty() && !b.frames.empty());
  if (changes.compare("the sequence", a.name, b.name) ||
      changes.compare("what is held out, " + b.name, a.held_out, b.held_out) ||
      changes.compare("the frames of " + b.name, frames(a), frames(b))) {
    return;
  }
  changes.note(is_known && a.frames != b.frames, "the frames of " + b.name);
  changes.note(a.calibration != b.calibration, "calib.txt or times.txt of " + b.name);
  changes.note(a.ground_truth != b.ground_truth, "the pose file of " + b.name);
}

}  // namespace

std::string describe_change(const SearchIdentity& before,
                            const SearchIdentity& now,
                            bool as_parts) {
  Changes changes;
  changes.note(before.configuration != now.configuration,
               fmt::format("the configuration ({})",
                           first_difference(before.configuration, now.configuration)));
  changes.note(before.program != now.program, "the program");
  for (const LayerIdentity& layer : now.layers) {
    const auto other = std::ranges::find_if(
        before.layers, [&](const LayerIdentity& one) { return one.is_layer_of(layer.key(0)); });
    if (other != before.layers.end()) {
      compare_layer(*other, layer, as_parts, changes);
    } else if (!as_parts) {
      changes.note(true, fmt::format("the layers (now also {} {})", layer.model, layer.layer));
    }
  }
  changes.note(!as_parts && before.layers.size() > now.layers.size(), "the layers (fewer now)");
  const auto only = [](const SearchIdentity& one) {
    return one.only_sequence ? std::to_string(*one.only_sequence) : "not given";
  };
  const bool same_part = as_parts || !changes.compare("--only-sequence", only(before), only(now));
  if (same_part &&
      !changes.compare("the sequences", before.sequences.size(), now.sequences.size())) {
    for (std::size_t i = 0; i < now.sequences.size(); ++i) {
      compare_sequence(before.sequences[i], now.sequences[i], as_parts, changes);
    }
  }
  changes.note(
      !as_parts && changes.words.empty() && before.rungs != now.rungs,
      now.rungs.size() == 1 ? "--exhaustive (now given)" : "the plan of halving or --exhaustive");
  return changes.words.empty() ? std::string()
                               : fmt::format("{} changed", fmt::join(changes.words, " and "));
}

}  // namespace stemvo::search
