// SPDX-License-Identifier: MIT
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "stemvo/error.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// A length of the camera's path that somebody else measured.
struct Way {
  enum class Kind {
    kBetweenSpeeds,  ///< from one speed to the next: it grows evenly
    kDistance,
    kHeld,  ///< since the last speed, as if that went on: for a first guess only
  };
  double from_s = 0.0;
  double to_s = 0.0;
  double metres = 0.0;
  double sigma_m = 0.0;
  Kind kind = Kind::kDistance;
};

/// Speeds and distances as a caller gives them, checked, made ways, and kept for the next frame.
class WayInput {
 public:
  explicit WayInput(ScaleSource source) : source_(source) {}

  /// Errors as Odometry::add_speed and add_distance; nothing changes then.
  [[nodiscard]] Status add_speed(double time_s, double metres_per_s, double sigma);
  [[nodiscard]] Status add_distance(double from_s, double to_s, double metres, double sigma);
  /// For the frame of this time: those given since the last call.
  [[nodiscard]] std::vector<Way> take(double time_s);
  /// Times may begin anew.
  void restart() { *this = WayInput(source_); }

 private:
  struct Speed {
    double time_s;
    double metres_per_s;
    double sigma;
  };
  ScaleSource source_;
  std::optional<Speed> last_speed_;
  double last_to_s_ = -std::numeric_limits<double>::infinity();  ///< of a distance
  std::vector<Way> ways_;
};

}  // namespace stemvo
