// SPDX-License-Identifier: MIT
#include "robustness/contenders.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "text/text_file.hpp"

namespace stemvo::robustness {
namespace {

struct FilterName {
  std::string model;
  int filter = 0;
};

/// MODEL:K.
std::optional<FilterName> parse_filter_name(const std::string& name) {
  constexpr std::size_t kMaxFilter = 1000000;  // as stem.filter
  const std::size_t colon = name.rfind(':');
  if (colon == std::string::npos || colon == 0) {
    return std::nullopt;
  }
  const auto filter = parse_index(name.substr(colon + 1));
  if (!filter || *filter > kMaxFilter) {
    return std::nullopt;
  }
  return FilterName{name.substr(0, colon), static_cast<int>(*filter)};
}

std::optional<int> plane_of(const std::string& color) {
  for (const auto& [name, filter] : {std::pair("red", 0), {"green", 1}, {"blue", 2}}) {
    if (color == name) {
      return filter;
    }
  }
  return std::nullopt;
}

Contender make_control(const std::string& name, Config config) {
  const StemOptions defaults;
  const std::optional<FilterName> filter = parse_filter_name(name);
  if (filter && filter->model == config.stem.model) {  // its sampling
    config.stem.filter = filter->filter;
    return {name, config};
  }
  config.stem.sampling_px = defaults.sampling_px;
  config.stem.model = filter ? filter->model : name;
  config.stem.filter = filter ? filter->filter : defaults.filter;
  if (const auto plane = plane_of(name)) {
    config.stem.model = "input_layer";
    config.stem.filter = *plane;
  }
  if (name == "orb" || name == "sift") {
    config.stem.model = "gray";
    config.features.method = name == "orb" ? FeatureMethod::kOrb : FeatureMethod::kSift;
    config.odometry.mode = OdometryMode::kTwoFrame;
  }
  return {name, config};
}

bool is_among(const std::string& name, const std::vector<std::string>& names) {
  return std::ranges::find(names, name) != names.end();
}

}  // namespace

const std::vector<std::string>& all_controls() {
  static const std::vector<std::string> kAll = {"gray", "red",    "green", "blue",
                                                "log",  "census", "orb",   "sift"};
  return kAll;
}

Expected<std::vector<Contender>> make_contenders(const Config& judged,
                                                 const std::vector<std::string>& controls,
                                                 bool has_color) {
  std::vector<std::string> names;
  for (const std::string& name : controls.empty() ? all_controls() : controls) {
    if (!parse_filter_name(name) && !is_among(name, all_controls())) {
      return fail(fmt::format("--controls: expected some of {} or MODEL:FILTER, found '{}'",
                              fmt::join(all_controls(), ", "), name));
    }
    const bool is_left_out = controls.empty() && !has_color && plane_of(name);
    if (!is_left_out && !is_among(name, names)) {
      names.push_back(name);
    }
  }
  std::vector<Contender> contenders = {{"judged", judged}};
  for (const std::string& name : names) {
    contenders.push_back(make_control(name, judged));
  }
  return contenders;
}

}  // namespace stemvo::robustness
