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
    case FrameState::kStationary:
      return "stationary";
    case FrameState::kLowParallax:
      return "low_parallax";
    case FrameState::kRotating:
      return "rotating";
    case FrameState::kGated:
      return "gated";
    case FrameState::kLost:
      return "lost";
    case FrameState::kNoImage:
      return "no_image";
  }
  return "unknown";
}

bool is_measured(FrameState state) {
  return state != FrameState::kGated && state != FrameState::kLost && state != FrameState::kNoImage;
}

std::string_view to_string(RoadState state) {
  switch (state) {
    case RoadState::kDisabled:
      return "disabled";
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
