// SPDX-License-Identifier: MIT
#include "calibration/refine_camera.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calibration/information.hpp"

namespace stemvo::calibration {
namespace {

/// Median length of a vector of two normal numbers of deviation 1: sqrt(2 ln 2).
constexpr double kMedianOfRayleigh = 1.1774100;

class Refinement {
 public:
  Refinement(std::vector<Segment>& segments,
             const Camera& given,
             const RefinementOptions& options,
             const std::function<bool(std::size_t, std::size_t)>& on_step)
      : segments_(segments),
        given_(given),
        options_(options),
        on_step_(on_step),
        adjustment_(segments, given) {}

  RefinedCamera run() {
    adjust(kNothingFree);
    for (int round = 0; round < options_.num_rounds && !stopped_; ++round) {
      reject_outliers();
      adjust(is_free_);
    }
    while (!stopped_ && hold_worst()) {
      adjust(is_free_);
    }
    RefinedCamera result;
    result.shared = adjustment_.shared();
    result.deviation = deviation_;
    result.is_determined = is_free_;
    result.refined_error_px = root_mean_square_px(segments_, adjustment_);
    result.given_error_px = stopped_ ? 0.0 : given_error_px();
    result.stopped = stopped_;
    if (on_step_ && !stopped_) {
      on_step_(num_steps_, num_steps_);
    }
    return result;
  }

 private:
  AdjustmentOptions adjustment(const SharedMask& is_free) const {
    AdjustmentOptions result;
    result.is_free = is_free;
    result.loss_scale_px = std::max(options_.min_loss_px, options_.loss_scale * sigma_px_);
    return result;
  }

  bool step() {
    ++num_steps_;
    // Solves to come are not known beforehand: a bound that is never reached before the end.
    const auto bound = static_cast<std::size_t>((options_.num_rounds + 2) *
                                                (AdjustmentOptions().max_iterations + 1));
    stopped_ = stopped_ || (on_step_ && !on_step_(num_steps_, std::max(bound, num_steps_ + 1)));
    return !stopped_;
  }

  void adjust(const SharedMask& is_free) {
    adjustment_.solve(adjustment(is_free), [this] { return step(); });
    measure_noise();
  }

  /// Robust deviation per coordinate: outliers do not move the median.
  void measure_noise() {
    std::vector<double> errors;
    for (const Segment& segment : segments_) {
      for (const Landmark& landmark : segment.landmarks) {
        for (const Observation& seen : landmark.observations) {
          errors.push_back(adjustment_.error_px(segment, landmark, seen));
        }
      }
    }
    if (!errors.empty()) {
      const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
      std::nth_element(errors.begin(), middle, errors.end());
      sigma_px_ = *middle / kMedianOfRayleigh;
    }
  }

  void reject_outliers() {
    const double bound_px = options_.outlier_bound * sigma_px_;
    for (Segment& segment : segments_) {
      for (Landmark& landmark : segment.landmarks) {
        std::erase_if(landmark.observations, [&](const Observation& seen) {
          return !(adjustment_.error_px(segment, landmark, seen) <= bound_px);
        });
      }
      std::erase_if(segment.landmarks, [&](const Landmark& landmark) {
        return static_cast<int>(landmark.observations.size()) < options_.min_observations;
      });
    }
  }

  /// Of the residuals under the loss, per degree of freedom.
  double residual_variance_px2(double loss_px) const {
    double sum = 0.0;
    double freedom = 0.0;
    for (const Segment& segment : segments_) {
      freedom -= 6.0 * static_cast<double>(segment.camera_from_first.size());
      for (const Landmark& landmark : segment.landmarks) {
        freedom += 2.0 * static_cast<double>(landmark.observations.size()) - 3.0;
        for (const Observation& seen : landmark.observations) {
          const double error = adjustment_.error_px(segment, landmark, seen) / loss_px;
          sum += loss_px * loss_px * std::log1p(error * error);
        }
      }
    }
    return sum / std::max(1.0, freedom);
  }

  /// Deviation over its bound; above 1 the number is not determined.
  double excess(int i) const {
    const auto at = static_cast<std::size_t>(i);
    const double unit = i == 0 ? given_.mean_focal_px() : 1.0;
    return deviation_[i] / (options_.max_deviation[at] * unit);
  }

  /// Puts the number that is determined least back to what was given; false: all are determined.
  bool hold_worst() {
    const double loss_px = adjustment(is_free_).loss_scale_px;
    const SharedVector deviation = standard_deviations(adjustment_.information(loss_px), is_free_,
                                                       residual_variance_px2(loss_px));
    std::optional<int> worst;
    for (int i = 0; i < kNumShared; ++i) {
      if (!is_free_[static_cast<std::size_t>(i)]) {
        continue;
      }
      deviation_[i] = deviation[i];
      if (i < kNumIntrinsics && !(excess(i) <= 1.0) && (!worst || excess(i) > excess(*worst))) {
        worst = i;
      }
    }
    if (!worst) {
      return false;
    }
    is_free_[static_cast<std::size_t>(*worst)] = false;
    SharedVector shared = adjustment_.shared();
    shared[*worst] = shared_of(given_)[*worst];
    if (!is_free_[0]) {  // without a focal length nothing is known of what bends it
      is_free_[3] = is_free_[4] = false;
      shared[3] = shared[4] = 0.0;
    }
    adjustment_.set_shared(shared);
    return true;
  }

  static double root_mean_square_px(const std::vector<Segment>& segments,
                                    const JointAdjustment& adjustment) {
    double sum = 0.0;
    std::size_t count = 0;
    for (const Segment& segment : segments) {
      for (const Landmark& landmark : segment.landmarks) {
        for (const Observation& seen : landmark.observations) {
          const double error = adjustment.error_px(segment, landmark, seen);
          sum += error * error;
          count += 2;
        }
      }
    }
    return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(count, 1)));
  }

  /// Same observations; poses and landmarks as good as the given camera lets them be.
  double given_error_px() {
    std::vector<Segment> segments = segments_;
    JointAdjustment with_given(segments, given_);
    with_given.solve(adjustment(kNothingFree), [this] { return step(); });
    return root_mean_square_px(segments, with_given);
  }

  std::vector<Segment>& segments_;
  Camera given_;
  RefinementOptions options_;
  const std::function<bool(std::size_t, std::size_t)>& on_step_;
  JointAdjustment adjustment_;
  SharedMask is_free_ = kAllFree;
  SharedVector deviation_ = SharedVector::Zero();
  double sigma_px_ = 0.2;
  std::size_t num_steps_ = 0;
  bool stopped_ = false;
};

}  // namespace

RefinedCamera refine_camera(std::vector<Segment>& segments,
                            const Camera& given,
                            const RefinementOptions& options,
                            const std::function<bool(std::size_t, std::size_t)>& on_step) {
  return Refinement(segments, given, options, on_step).run();
}

}  // namespace stemvo::calibration
