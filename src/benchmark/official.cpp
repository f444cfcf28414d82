// SPDX-License-Identifier: MIT
#include "benchmark/official.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace stemvo::benchmark {
namespace {

constexpr std::array<OfficialSequence, 11> kSequences = {{
    {"00", 4541, 3724, 1241, 376},
    {"01", 1101, 2453, 1241, 376},
    {"02", 4661, 5067, 1241, 376},
    {"03", 801, 561, 1242, 375},
    {"04", 271, 394, 1226, 370},
    {"05", 2761, 2206, 1226, 370},
    {"06", 1101, 1233, 1226, 370},
    {"07", 1101, 695, 1226, 370},
    {"08", 4071, 3223, 1226, 370},
    {"09", 1591, 1705, 1226, 370},
    {"10", 1201, 920, 1226, 370},
}};

constexpr double kLengthTolerance_m = 1.5;

double length_m(const Trajectory& poses) {
  double sum = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    sum += (poses[i].translation - poses[i - 1].translation).norm();
  }
  return sum;
}

}  // namespace

std::optional<OfficialSequence> find_official(std::string_view name) {
  const auto* const found = std::find_if(kSequences.begin(), kSequences.end(),
                                         [&](const auto& one) { return one.name == name; });
  return found == kSequences.end() ? std::nullopt : std::optional(*found);
}

bool is_official(const OfficialSequence& official, const KittiSequence& sequence) {
  const Camera& camera = sequence.camera();
  return sequence.range().begin == 0 && sequence.size() == official.num_frames &&
         camera.width_px == official.width_px && camera.height_px == official.height_px &&
         sequence.ground_truth() &&
         std::abs(length_m(*sequence.ground_truth()) - official.length_m) <= kLengthTolerance_m;
}

}  // namespace stemvo::benchmark
