// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "config/config.hpp"
#include "stemvo/error.hpp"

namespace stemvo::robustness {

/// A channel on trial.
struct Contender {
  std::string name;
  Config config;
};

/// gray, log, census: hand-made channels, all else alike; red, green, blue: the same where frames
/// are colour; orb, sift: the paper's pairs of frames on gray. A control may also be MODEL:FILTER,
/// another filter of a network.
[[nodiscard]] const std::vector<std::string>& all_controls();

/// The judged configuration first, then with other channels; a name given twice counts once. Empty
/// `controls`: all, colours only where frames have them. Errors: an unknown name.
[[nodiscard]] Expected<std::vector<Contender>> make_contenders(
    const Config& judged, const std::vector<std::string>& controls, bool has_color);

}  // namespace stemvo::robustness
