// SPDX-License-Identifier: MIT
#pragma once

#include <nlohmann/json.hpp>

#include "stemvo/report/timing.hpp"

namespace stemvo {

/// The key `timing` of metrics.json.
[[nodiscard]] nlohmann::ordered_json timing_json(const TimingReport& report);

}  // namespace stemvo
