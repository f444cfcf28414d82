// SPDX-License-Identifier: MIT
#include "calibration/refine_camera.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>

#include "calibration/joint_adjustment.hpp"
#include "geometry/degrees.hpp"
#include "geometry/median.hpp"

namespace stemvo::calibration {
namespace {

constexpr int kNumRounds = 3;          ///< of solving and rejecting with a free camera
constexpr double kOutlierBound = 4.0;  ///< reprojection error, robust deviations per coordinate
constexpr double kLossScale = 3.0;     ///< of the Cauchy loss, likewise
constexpr double kMinLoss_px = 0.05;
constexpr double kMaxFocalDeviation = 0.005;  ///< relative: more is not determined
constexpr double kMaxCenterDeviation_px = 2.0;
/// Median length of a vector of two normal numbers of deviation 1: sqrt(2 ln 2).
constexpr double kMedianOfRayleigh = 1.1774100;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Of the free numbers; infinite where the information is singular. The larger of two: the inverse
/// information times the variance of the residuals, and the cluster-robust one (Liang and Zeger,
/// Biometrika 1986) with segments as clusters, which also sees errors that the tracks of a segment
/// share.
Eigen::VectorXd standard_deviations(const SharedInformation& information,
                                    const std::vector<int>& free,
                                    double residual_variance_px2) {
  const auto n = static_cast<Eigen::Index>(free.size());
  const Eigen::MatrixXd hessian = information.hessian(free, free);
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(n, n);
  for (const SharedVector& all : information.gradients) {
    const Eigen::VectorXd gradient = all(free);
    scatter += gradient * gradient.transpose();
  }
  // The numbers differ in size: they are brought to unit information before the test of rank.
  const Eigen::VectorXd unit = hessian.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::FullPivLU<Eigen::MatrixXd> factors(unit.asDiagonal() * hessian * unit.asDiagonal());
  if (!unit.allFinite() || !hessian.allFinite() || !factors.isInvertible()) {
    return Eigen::VectorXd::Constant(n, kInfinity);
  }
  const Eigen::MatrixXd inverse = unit.asDiagonal() * factors.inverse() * unit.asDiagonal();
  const auto num_segments = static_cast<double>(information.gradients.size());
  const double few = num_segments / std::max(1.0, num_segments - static_cast<double>(n));
  const Eigen::MatrixXd clustered = few * inverse * scatter * inverse;
  const Eigen::VectorXd simple = residual_variance_px2 * inverse.diagonal();
  const Eigen::VectorXd robust = clustered.diagonal();
  return simple.cwiseMax(robust).cwiseMax(0.0).cwiseSqrt();
}

class Refinement {
 public:
  Refinement(const std::vector<Segment>& segments,
             const Camera& given,
             const std::function<bool(std::size_t, std::size_t)>& on_step)
      : on_step_(on_step), adjustment_(segments, given) {
    report_.given = given;
    const std::array<const char*, kNumShared> names = {"focal length", "principal point x",
                                                       "principal point y", "k1", "k2"};
    const std::array<double, kNumShared> max_deviation = {
        given.mean_focal_px() * kMaxFocalDeviation, kMaxCenterDeviation_px, kMaxCenterDeviation_px,
        kInfinity, kInfinity};
    for (std::size_t i = 0; i < names.size(); ++i) {
      report_.parameters[i] = {
          names[i], adjustment_.shared[static_cast<int>(i)], 0.0, 0.0, max_deviation[i], true};
    }
  }

  CalibrationReport run() {
    adjust({});
    for (int round = 0; round < kNumRounds && !report_.interrupted; ++round) {
      adjustment_.reject_outliers(kOutlierBound * sigma_px_);
      adjust(free_mask());
    }
    while (!report_.interrupted && hold_worst()) {
      adjust(free_mask());
    }
    for (int i = 0; i < kNumShared; ++i) {
      parameter(i).refined = adjustment_.shared[i];
    }
    report_.refined = with_shared(report_.given, adjustment_.shared);
    report_.num_landmarks = adjustment_.num_landmarks();
    report_.num_observations = adjustment_.errors_px().size();
    report_.turned_deg = kDegPerRad * adjustment_.turned_rad();
    report_.refined_error_px = root_mean_square_px();
    if (!report_.interrupted) {
      // Same observations; poses and landmarks as good as the given camera lets them be.
      adjustment_.shared = shared_of(report_.given);
      adjust({});
      report_.given_error_px = root_mean_square_px();
    }
    if (on_step_ && !report_.interrupted) {
      on_step_(num_steps_, num_steps_);
    }
    return std::move(report_);
  }

 private:
  CalibratedParameter& parameter(int i) { return report_.parameters[static_cast<std::size_t>(i)]; }

  SharedMask free_mask() const {
    SharedMask is_free;
    std::transform(report_.parameters.begin(), report_.parameters.end(), is_free.begin(),
                   [](const CalibratedParameter& parameter) { return parameter.is_determined; });
    return is_free;
  }

  double loss_scale_px() const { return std::max(kMinLoss_px, kLossScale * sigma_px_); }

  bool step() {
    ++num_steps_;
    // Solves to come are not known beforehand: a bound that is never reached before the end.
    constexpr std::size_t kBound = (kNumRounds + 2) * (JointAdjustment::kMaxIterations + 1);
    report_.interrupted = report_.interrupted ||
                          (on_step_ && !on_step_(num_steps_, std::max(kBound, num_steps_ + 1)));
    return !report_.interrupted;
  }

  /// Then measures the noise per coordinate: outliers do not move the median.
  void adjust(const SharedMask& is_free) {
    adjustment_.solve(is_free, loss_scale_px(), [this] { return step(); });
    sigma_px_ = median(adjustment_.errors_px()) / kMedianOfRayleigh;
  }

  /// Of the residuals under the loss, per degree of freedom.
  double residual_variance_px2() const {
    const double loss_px = loss_scale_px();
    const std::vector<double> errors = adjustment_.errors_px();
    double sum = 0.0;
    for (const double error : errors) {
      const double scaled = error / loss_px;
      sum += loss_px * loss_px * std::log1p(scaled * scaled);
    }
    const double freedom = 2.0 * static_cast<double>(errors.size()) -
                           3.0 * static_cast<double>(adjustment_.num_landmarks()) -
                           6.0 * static_cast<double>(adjustment_.num_keyframes());
    return sum / std::max(1.0, freedom);
  }

  void measure_deviations() {
    std::vector<int> free;
    for (int i = 0; i < kNumShared; ++i) {
      if (parameter(i).is_determined) {
        free.push_back(i);
      }
    }
    if (free.empty()) {
      return;
    }
    const Eigen::VectorXd deviations = standard_deviations(adjustment_.information(loss_scale_px()),
                                                           free, residual_variance_px2());
    for (std::size_t i = 0; i < free.size(); ++i) {
      parameter(free[i]).deviation = deviations[static_cast<Eigen::Index>(i)];
    }
  }

  /// Puts the number that is determined least back to what was given; false: all are determined.
  bool hold_worst() {
    measure_deviations();
    const auto excess = [](const CalibratedParameter& number) {
      return number.deviation / number.max_deviation;
    };
    CalibratedParameter* worst = nullptr;
    for (int i = 0; i < kNumIntrinsics; ++i) {
      CalibratedParameter& number = parameter(i);
      if (number.is_determined && !(excess(number) <= 1.0) &&
          (worst == nullptr || excess(number) > excess(*worst))) {
        worst = &number;
      }
    }
    if (worst == nullptr) {
      return false;
    }
    worst->is_determined = false;
    if (!parameter(0).is_determined) {  // without a focal length nothing is known of what bends it
      parameter(3).is_determined = parameter(4).is_determined = false;
    }
    for (int i = 0; i < kNumShared; ++i) {
      if (!parameter(i).is_determined) {
        adjustment_.shared[i] = parameter(i).given;
      }
    }
    return true;
  }

  double root_mean_square_px() const {
    const std::vector<double> errors = adjustment_.errors_px();
    double sum = 0.0;
    for (const double error : errors) {
      sum += error * error;
    }
    return std::sqrt(sum / std::max(1.0, 2.0 * static_cast<double>(errors.size())));
  }

  const std::function<bool(std::size_t, std::size_t)>& on_step_;
  JointAdjustment adjustment_;
  CalibrationReport report_;
  double sigma_px_ = 0.2;
  std::size_t num_steps_ = 0;
};

}  // namespace

CalibrationReport refine_camera(const std::vector<Segment>& segments,
                                const Camera& given,
                                const std::function<bool(std::size_t, std::size_t)>& on_step) {
  return Refinement(segments, given, on_step).run();
}

}  // namespace stemvo::calibration
