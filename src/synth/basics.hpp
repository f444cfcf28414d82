// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

namespace stemvo::synth {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

inline constexpr double kPi = std::numbers::pi;
[[nodiscard]] constexpr double radians(double degrees) { return degrees * kPi / 180.0; }

/// Turns about the camera's axes: y, then x, then z.
[[nodiscard]] inline Eigen::Matrix3d rotation(double yaw_rad, double pitch_rad, double roll_rad) {
  return (Eigen::AngleAxisd(yaw_rad, Vec3::UnitY()) * Eigen::AngleAxisd(pitch_rad, Vec3::UnitX()) *
          Eigen::AngleAxisd(roll_rad, Vec3::UnitZ()))
      .toRotationMatrix();
}

using Rgb = cv::Vec3f;  // 1 is white

[[nodiscard]] inline Rgb blend(const Rgb& from, const Rgb& to, float share) {
  return from + share * (to - from);
}

/// splitmix64's finaliser (Steele, Lea, Flood 2014): every bit of the result depends on every bit
/// of the input. All randomness of a drive comes from it, by what is drawn and never by when, so
/// that neither the order of the work nor the number of threads matters.
[[nodiscard]] constexpr std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

template <typename... Keys>
[[nodiscard]] constexpr std::uint64_t hash_of(std::uint64_t seed, Keys... keys) {
  std::uint64_t h = mix(seed);
  ((h = mix(h ^ static_cast<std::uint64_t>(keys))), ...);
  return h;
}

/// [0, 1).
[[nodiscard]] constexpr double unit(std::uint64_t hash) {
  return static_cast<double>(hash >> 11) * 0x1.0p-53;
}

/// A row of draws for one object, named by its keys.
class Draw {
 public:
  template <typename... Keys>
  explicit Draw(std::uint64_t seed, Keys... keys) : state_(hash_of(seed, keys...)) {}

  [[nodiscard]] double next() { return unit(state_ = mix(state_)); }
  [[nodiscard]] double in(double low, double high) { return low + (high - low) * next(); }
  [[nodiscard]] float in_float(double low, double high) {
    return static_cast<float>(in(low, high));
  }
  [[nodiscard]] bool chance(double probability) { return next() < probability; }
  [[nodiscard]] std::uint32_t bits() {
    return static_cast<std::uint32_t>((state_ = mix(state_)) >> 32);
  }

 private:
  std::uint64_t state_;
};

/// A smooth random function of time: five sines with incommensurate periods.
class Sway {
 public:
  /// `key` tells the sways of one drive apart.
  Sway(std::uint64_t seed, int key, double deviation, double slowest_hz, double fastest_hz) {
    constexpr double kCount = 5.0;
    Draw draw(seed, 'w', key);
    const double amplitude = deviation * std::sqrt(2.0 / kCount);
    for (int i = 0; Wave& wave : waves_) {
      wave.frequency_hz =
          slowest_hz * std::pow(fastest_hz / slowest_hz, (i++ + draw.next()) / kCount);
      wave.phase_rad = draw.in(0.0, 2.0 * kPi);
      wave.amplitude = amplitude * draw.in(0.8, 1.2);
    }
  }

  [[nodiscard]] double at(double time_s) const {
    double sum = 0.0;
    for (const Wave& wave : waves_) {
      sum += wave.amplitude * std::sin(2.0 * kPi * wave.frequency_hz * time_s + wave.phase_rad);
    }
    return sum;
  }

 private:
  struct Wave {
    double frequency_hz;
    double phase_rad;
    double amplitude;
  };
  std::array<Wave, 5> waves_{};
};

}  // namespace stemvo::synth
