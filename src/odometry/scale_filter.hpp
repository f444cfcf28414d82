// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

namespace stemvo {

/// The source that measures metres per unit.
enum class ScaleWitness {
  kRoad,  ///< the camera's height above it
  kWay,   ///< a speed or a distance from outside
};

/// Drift of log(metres per unit) in a second, standard deviation: the map stretches by 1 % a second
/// on real clips, steadily; a random walk must be loose enough to follow without lagging behind.
inline constexpr double kScaleDrift = 0.019;

/// Kalman filter of log(metres per unit), a random walk. A measurement far from the state counts
/// little (Huber; still less beyond three sigmas), but several in a row of one witness on the same
/// side, for as long as it was believed before, say that the state is wrong: it opens up. A way
/// that is believed silences the road's doubts: it needs no model of what is seen. All counts are
/// of time: neighbouring frames see the same road, so more of them tell no more.
class ScaleFilter {
 public:
  /// `drift_sigma`: of the random walk in a second.
  explicit ScaleFilter(double drift_sigma) : drift_sigma_(drift_sigma) {}

  static constexpr double kUnknownSigma = 1.0;

  /// Time passes: the map may have drifted.
  void predict(double interval_s);
  /// Returns whether the measurement was believed. `sigma` of a road: if it were measured ten times
  /// a second.
  bool update(double log_scale, double sigma, ScaleWitness witness);
  /// The measurement's distance from the state, standard deviations; nullopt where there is none.
  [[nodiscard]] std::optional<double> innovation(double log_scale, double sigma) const {
    if (!is_initialized_) {
      return std::nullopt;
    }
    return (log_scale - log_scale_) / std::hypot(sigma, sigma_);
  }
  void shift(double log_factor) { log_scale_ += log_factor; }
  void restart() { *this = ScaleFilter(drift_sigma_); }

  [[nodiscard]] bool is_initialized() const { return is_initialized_; }
  [[nodiscard]] double log_scale() const { return log_scale_; }
  [[nodiscard]] double sigma() const { return sigma_; }
  /// A change of late that no drift of a map explains: what measured was no measure of the motion.
  [[nodiscard]] double wander() const { return wander_; }
  /// So many times `sigma` is the error, by the distances of the last ways (at most 5).
  [[nodiscard]] double way_sigma_factor() const { return std::sqrt(std::max(1.0, way_distance2_)); }

 private:
  struct Record {
    double since_s = 0.0;     ///< the last measurement
    double doubted_s = 0.0;   ///< in a row on one side; the sign is the side
    double believed_s = 0.0;  ///< since the state opened up, as far as it counts
  };
  [[nodiscard]] Record& record(ScaleWitness witness) {
    return records_[static_cast<std::size_t>(witness)];
  }
  /// The distance of the measurement in standard deviations, after the state opened up, if it has
  /// to.
  double judge(double innovation, double sigma, ScaleWitness witness);

  double drift_sigma_;
  bool is_initialized_ = false;
  double log_scale_ = 0.0;
  double sigma_ = kUnknownSigma;
  /// Trend of log_scale_, per second: a map that stretches steadily would stay behind by as much as
  /// the filter is slow. By ways alone, where no road says otherwise.
  double trend_ = 0.0;
  double from_mean_ = 0.0;         ///< log_scale_, less its mean of the last seconds
  double wander_ = 0.0;            ///< the most that this was lately, more than by drift
  std::array<Record, 2> records_;  ///< by witness
  double way_distance2_ = 1.0;     ///< mean square of ways' distances, standard deviations
};

}  // namespace stemvo
