// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace stemvo::benchmark {

/// For people: "camera height", "per-step ground-truth scale".
[[nodiscard]] std::string_view words_for(const nlohmann::ordered_json& scale_source);

/// "all 4541 frames", "clip 0:200 of 4541", "frames 0:60".
[[nodiscard]] std::string describe_frames(const nlohmann::ordered_json& sequence);

/// benchmark.json for people: a table over all sequences, then one per sequence with the
/// zero-motion baseline and, where all official frames ran, the published numbers.
[[nodiscard]] std::string format_markdown(const nlohmann::ordered_json& report);

}  // namespace stemvo::benchmark
