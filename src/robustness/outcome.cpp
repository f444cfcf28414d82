// SPDX-License-Identifier: MIT
#include "robustness/outcome.hpp"

#include <algorithm>
#include <cstdint>

#include "geometry/degrees.hpp"
#include "internal_check.hpp"

namespace stemvo::robustness {
namespace {

constexpr double kJump_deg = 1.0;

bool is_found(FrameState state) { return is_measured(state) && state != FrameState::kInitializing; }

double rotation_error_deg(std::span<const Rigid3> estimate,
                          std::span<const Rigid3> ground_truth,
                          std::size_t frame) {
  const Rigid3 step = estimate[frame - 1].inverse() * estimate[frame];
  const Rigid3 true_step = ground_truth[frame - 1].inverse() * ground_truth[frame];
  return kDegPerRad * (step.inverse() * true_step).angle_rad();
}

}  // namespace

void add_states(std::span<const FrameState> states,
                std::span<const Rigid3> estimate,
                std::span<const Rigid3> ground_truth,
                const std::vector<bool>& is_disturbed,
                Outcome& outcome) {
  STEMVO_CHECK(!states.empty() && states.size() == estimate.size() &&
                   states.size() == ground_truth.size() && states.size() == is_disturbed.size(),
               "a state, a pose and the truth of every frame");
  std::size_t num_lost = 0;  // since the disturbance ended
  bool is_searching = false;
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (is_disturbed[i]) {
      is_searching = true;
      outcome.is_recovered = outcome.is_recovered && num_lost == 0;
      num_lost = 0;
    } else if (is_searching) {
      is_searching = !is_found(states[i]);
      num_lost += is_searching ? 1 : 0;
      outcome.recovery_frames = std::max(outcome.recovery_frames.value_or(0), num_lost);
      num_lost = is_searching ? num_lost : 0;
    }
    if (i > 0 && is_found(states[i - 1]) && is_found(states[i]) &&
        rotation_error_deg(estimate, ground_truth, i) > kJump_deg) {
      ++outcome.jumps;
    }
  }
  outcome.is_recovered = outcome.is_recovered && num_lost == 0;
  outcome.tracked = static_cast<double>(std::ranges::count_if(states, is_measured)) /
                    static_cast<double>(states.size());
}

void add_errors(std::span<const Rigid3> estimate,
                std::span<const Rigid3> ground_truth,
                const EvaluationOptions& options,
                Outcome& outcome) {
  const Metrics metrics = evaluate(estimate, ground_truth, options);
  outcome.t_rel_percent = metrics.t_rel_percent;
  outcome.r_rel_deg_per_100m = metrics.r_rel_deg_per_100m;
  outcome.dense = dense_errors(estimate, ground_truth, SIZE_MAX);
}

}  // namespace stemvo::robustness
