// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <optional>

namespace stemvo {

/// Who measures metres per unit.
enum class ScaleWitness {
  kRoad,  ///< the camera's height above it
  kWay,   ///< a speed or a distance from outside
};

/// Kalman filter of log(metres per unit), a random walk. A measurement far from the state counts
/// little (Huber; still less beyond three sigmas), but several in a row of one witness on the same
/// side, as many as were believed before, say that the state is wrong: it opens up. A way that is
/// believed silences the road's doubts: it needs no model of what is seen.
class ScaleFilter {
 public:
  /// `drift_sigma`: of the random walk, per frame. `joins_frames`: false where every measurement is
  /// believed as it comes.
  explicit ScaleFilter(double drift_sigma, bool joins_frames = true)
      : drift_sigma_(drift_sigma), joins_frames_(joins_frames) {}

  static constexpr double kUnknownSigma = 1.0;

  /// One frame passes: the map may have drifted.
  void predict();
  /// Returns whether the measurement was believed; always where frames are not joined.
  bool update(double log_scale, double sigma, ScaleWitness witness);
  /// The measurement's distance from the state, standard deviations; nullopt where there is none.
  [[nodiscard]] std::optional<double> innovation(double log_scale, double sigma) const;
  void shift(double log_factor) { log_scale_ += log_factor; }
  void restart();

  [[nodiscard]] bool is_initialized() const { return is_initialized_; }
  [[nodiscard]] double log_scale() const { return log_scale_; }
  [[nodiscard]] double sigma() const { return sigma_; }

 private:
  struct Record {
    int num_doubts = 0;    ///< measurements in a row on one side; the sign is the side
    int num_believed = 0;  ///< since the state opened up, as far as it counts
  };
  /// The distance of the measurement in standard deviations, after the state opened up, if it has
  /// to.
  double judge(double innovation, double sigma, ScaleWitness witness);

  double drift_sigma_;
  bool joins_frames_;
  bool is_initialized_ = false;
  double log_scale_ = 0.0;
  double sigma_ = kUnknownSigma;
  /// Of log_scale_, per frame: a map that stretches steadily would stay behind by as much as the
  /// filter is slow. By ways alone, where no road says otherwise.
  double trend_ = 0.0;
  int frames_since_way_ = 0;       ///< since the last way, if no road came after it
  std::array<Record, 2> records_;  ///< by witness
};

}  // namespace stemvo
