// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>

namespace stemvo::synth {

/// A smooth random function of time: five sines with incommensurate periods.
class Sway {
 public:
  /// `key` tells the sways of one drive apart.
  Sway(
      std::uint64_t seed, int key, double standard_deviation, double slowest_hz, double fastest_hz);

  [[nodiscard]] double at(double time_s) const;

 private:
  struct Wave {
    double frequency_hz;
    double phase_rad;
    double amplitude;
  };
  std::array<Wave, 5> waves_{};
};

}  // namespace stemvo::synth
