// SPDX-License-Identifier: MIT
#pragma once

#include "stemvo/config.hpp"
#include "stemvo/geometry/rigid3.hpp"

namespace stemvo {

/// Length of a step that nothing measures: one unit where no scale is asked for.
[[nodiscard]] inline double assumed_step(const ScaleOptions& scale) {
  return scale.source == "none" ? 1.0 : scale.constant_m;
}

/// An equal share of a motion that took several frames.
[[nodiscard]] inline Rigid3 motion_of_one_frame(const Rigid3& motion, int num_frames) {
  return {so3_exp(so3_log(motion.rotation) / num_frames), motion.translation / num_frames};
}

}  // namespace stemvo
