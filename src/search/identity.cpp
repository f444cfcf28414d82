// SPDX-License-Identifier: MIT
// A search's inputs, and which of them have changed since.
#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "internal_check.hpp"
#include "options/visit.hpp"
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

/// One thing that records depend on, by its value or by a hash (empty: not known).
struct Fact {
  std::string name;
  std::string value;
  std::string hash = {};
};

/// Part of a name that tells the feature method.
std::string unless_default(const std::string& features) {
  return features == options::to_string(FeatureOptions().method) ? "" : " " + features;
}

std::vector<Fact> facts_of(const SearchIdentity& identity, bool as_part) {
  std::vector<Fact> facts = {{"the program", "", identity.program}};
  std::vector<std::string> layers;
  for (const LayerIdentity& layer : identity.layers) {
    const std::string& name =
        layers.emplace_back(layer.model + " " + layer.layer + unless_default(layer.features));
    facts.push_back({"the model " + name, "", layer.hash});
    facts.push_back({"the sampling of " + name, fmt::format("{} px", layer.sampling_px)});
    if (!as_part) {
      facts.push_back({"the filters of " + name, fmt::format("{}:{}", layer.first, layer.last)});
    }
  }
  std::vector<std::string> sequences;
  for (const SequenceIdentity& one : identity.sequences) {
    const std::string& name =
        sequences.emplace_back(one.name + (one.held_out ? " (held out)" : ""));
    facts.push_back({"the frames of " + name,
                     fmt::format("{}:{}", one.first_frame, one.end_frame()), one.frames});
    facts.push_back({"calib.txt or times.txt of " + name, "", one.calibration});
    facts.push_back({"the pose file of " + name, "", one.ground_truth});
  }
  facts.push_back({"the sequences", fmt::format("{}", fmt::join(sequences, ", "))});
  if (!as_part) {
    const auto& only = identity.only_sequence;
    facts.push_back({"the layers", fmt::format("{}", fmt::join(layers, ", "))});
    facts.push_back({"--only-sequence", only ? std::to_string(*only) : "not given"});
    facts.push_back({"--exhaustive", identity.rungs.size() == 1 ? "given" : "not given"});
  }
  return facts;
}

}  // namespace

std::string to_string(const FilterKey& key) {
  return fmt::format("{} {} {}{}", key.model, key.layer, key.filter, unless_default(key.features));
}

std::size_t SearchIdentity::count(bool baselines) const {
  std::size_t sum = 0;
  for (const LayerIdentity& layer : layers) {
    sum += layer.baseline == baselines ? layer.size() : 0;
  }
  return sum;
}

std::string SearchIdentity::road_of(const std::string& sequence) const {
  const auto found = std::ranges::find(sequences, sequence, &SequenceIdentity::name);
  return found == sequences.end() ? std::string()
                                  : sequence.substr(0, sequence.size() - found->disturbance.size());
}

const LayerIdentity& SearchIdentity::layer_of(const FilterKey& key) const {
  const auto layer = std::ranges::find_if(layers, [&key](const LayerIdentity& one) {
    return one.is_layer_of(key) && one.first <= key.filter && key.filter < one.last;
  });
  STEMVO_CHECK(layer != layers.end(), "each row has a layer");
  return *layer;
}

std::string SearchIdentity::change_to(const SearchIdentity& now, bool as_parts) const {
  std::vector<std::string> changed;
  if (configuration != now.configuration) {
    changed.push_back(
        fmt::format("the configuration ({})", first_difference(configuration, now.configuration)));
  }
  const std::vector<Fact> old_facts = facts_of(*this, as_parts);
  for (const Fact& fact : facts_of(now, as_parts)) {
    const auto old = std::ranges::find(old_facts, fact.name, &Fact::name);
    if (old == old_facts.end()) {
      continue;  // of another layer or sequence, which the list of them tells
    }
    if (old->value != fact.value) {
      changed.push_back(fmt::format("{} ({}, now {})", fact.name, old->value, fact.value));
    } else if (!old->hash.empty() && !fact.hash.empty() && old->hash != fact.hash) {
      changed.push_back(fact.name);
    }
  }
  return changed.empty() ? std::string() : fmt::format("{} changed", fmt::join(changed, " and "));
}

}  // namespace stemvo::search
