// SPDX-License-Identifier: MIT
#include "stemvo/odometry/odometry.hpp"

namespace stemvo {

std::string_view to_string(FrameState state) {
  switch (state) {
    case FrameState::kFirst:
      return "first";
    case FrameState::kInitializing:
      return "initializing";
    case FrameState::kTracking:
      return "tracking";
    case FrameState::kStanding:
      return "standing";
    case FrameState::kCreeping:
      return "creeping";
    case FrameState::kRotating:
      return "rotating";
    case FrameState::kGated:
      return "gated";
    case FrameState::kLost:
      return "lost";
    case FrameState::kBroken:
      return "broken";
  }
  return "unknown";
}

bool is_measured(FrameState state) {
  return state != FrameState::kGated && state != FrameState::kLost && state != FrameState::kBroken;
}

std::string_view to_string(RoadState state) {
  switch (state) {
    case RoadState::kNotAsked:
      return "-";
    case RoadState::kNone:
      return "none";
    case RoadState::kHeld:
      return "held";
    case RoadState::kMeasured:
      return "measured";
  }
  return "unknown";
}

}  // namespace stemvo
