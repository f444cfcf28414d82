// SPDX-License-Identifier: MIT
#pragma once

#include "odometry/map_tracker.hpp"

namespace stemvo::testing {

/// Both halves of a frame: its place, then the refinement.
inline bool add_frame(MapTracker& tracker,
                      int frame,
                      const Rigid3& world_from_prev,
                      const Matches& matches,
                      MeasuredMotion& motion) {
  if (!tracker.place(frame, world_from_prev, matches, motion)) {
    return false;
  }
  tracker.extend(matches, motion);
  return true;
}

}  // namespace stemvo::testing
