// SPDX-License-Identifier: MIT
#include "dataset/synth/sway.hpp"

#include <cmath>
#include <numbers>

#include "dataset/synth/hash.hpp"

namespace stemvo::synth {

Sway::Sway(
    std::uint64_t seed, int key, double standard_deviation, double slowest_hz, double fastest_hz) {
  constexpr double kPi = std::numbers::pi;
  Draw draw(seed, 'w', key);
  const double amplitude = standard_deviation * std::sqrt(2.0 / static_cast<double>(waves_.size()));
  for (std::size_t i = 0; i < waves_.size(); ++i) {
    const double t = (static_cast<double>(i) + draw.next()) / static_cast<double>(waves_.size());
    waves_[i] = {slowest_hz * std::pow(fastest_hz / slowest_hz, t), draw.in(0.0, 2.0 * kPi),
                 amplitude * draw.in(0.8, 1.2)};
  }
}

double Sway::at(double time_s) const {
  constexpr double kPi = std::numbers::pi;
  double sum = 0.0;
  for (const Wave& wave : waves_) {
    sum += wave.amplitude * std::sin(2.0 * kPi * wave.frequency_hz * time_s + wave.phase_rad);
  }
  return sum;
}

}  // namespace stemvo::synth
