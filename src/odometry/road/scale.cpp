// SPDX-License-Identifier: MIT
#include "odometry/road/scale.hpp"

#include <cmath>

#include <Eigen/LU>

#include "odometry/road/region.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kMaxPositions = 64;  ///< of a path

constexpr double kTypicalStep_m = 0.8;  ///< where a search for the first scale starts
constexpr double kMinPriorSigma = 0.03;
constexpr double kSearchSigma = 0.3;
constexpr int kFramesUntilSearch = 5;
/// Nearer than this share of the wanted baseline, a pair of frames is not worth looking at.
constexpr double kStandingShare = 0.25;
/// A landmark is off the plane beyond so many standard deviations of its inverse depth and of the
/// road's, which is no plane.
constexpr double kOffPlane = 2.5;
constexpr double kPlaneSigma = 0.07;
/// One that would be on a plane twice as far away as well proves nothing.
constexpr double kMaxLandmarkSigma = 0.2;

/// The joint measurement of the estimators that measured.
struct Joined {
  int num = 0;
  double log_scale = 0.0;
  double sigma = 0.0;
};

/// They share the error of flatness_sigma: the same road, not quite as the model.
Joined join(const RoadMeasurement& dense, const RoadMeasurement& points, double flatness_sigma) {
  Joined joined;
  double weight = 0.0;
  for (const RoadMeasurement* road : {&dense, &points}) {
    if (road->is_valid) {
      ++joined.num;
      weight += 1.0 / (road->sigma * road->sigma);
      joined.log_scale += road->log_scale / (road->sigma * road->sigma);
    }
  }
  joined.log_scale /= weight;
  joined.sigma = std::hypot(1.0 / std::sqrt(weight), flatness_sigma);
  return joined;
}

}  // namespace

void RoadScale::predict_profile(double metres_per_unit, RoadPrior& prior) const {
  const double weight = 1.0 / (options_.heave_sigma_m * options_.heave_sigma_m);
  Eigen::Matrix3d information =
      Eigen::Vector3d(weight, 1.0 / (options_.free_slope_sigma_rad * options_.free_slope_sigma_rad),
                      1.0 / (options_.bend_sigma_per_m * options_.bend_sigma_per_m))
          .asDiagonal();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : path_) {
    const double z = position.z() * metres_per_unit;
    if (!(z > -options_.path_m && z < 0.0)) {
      break;  // farther back, or turned round: the road may have bent otherwise
    }
    const Eigen::Vector3d row(1.0, z, z * z);
    information += weight * row * row.transpose();
    right += weight * position.y() * metres_per_unit * row;
  }
  const Eigen::Matrix3d covariance = information.inverse();
  const Eigen::Vector3d profile = covariance * right;
  const Eigen::DiagonalMatrix<double, 2> units(1.0, options_.camera_height_m);
  const Eigen::Matrix2d of_slope_and_drop = units * covariance.bottomRightCorner<2, 2>() * units;
  prior.slope_rad = profile[1];
  prior.drop = options_.camera_height_m * profile[2];
  prior.profile_information = of_slope_and_drop.inverse();
}

const RoadScale::Past* RoadScale::pick_past(const ScaleFilter& filter) const {
  if (past_.empty() || !(past_.front().now_from_past.translation.norm() > 0.0)) {
    return nullptr;
  }
  if (!filter.is_initialized()) {
    return &past_.front();
  }
  const double metres_per_unit = std::exp(filter.log_scale());
  const Past* best = nullptr;
  for (const Past& past : past_) {
    const double baseline_m = past.now_from_past.translation.norm() * metres_per_unit;
    if (baseline_m >= kStandingShare * options_.min_baseline_m) {
      best = &past;
    }
    if (baseline_m >= options_.min_baseline_m) {
      break;
    }
  }
  return best;
}

RoadPrior RoadScale::make_prior(const Rigid3& motion, const ScaleFilter& filter) const {
  RoadPrior prior;
  prior.roll_sigma = options_.roll_sigma_rad;
  prior.log_scale = filter.log_scale();
  prior.log_scale_sigma = std::max(kMinPriorSigma, filter.sigma());
  if (!filter.is_initialized()) {
    prior.log_scale = std::log(kTypicalStep_m / motion.translation.norm());
    prior.log_scale_sigma = ScaleFilter::kUnknownSigma;
  } else if (frames_unmeasured_ >= kFramesUntilSearch) {
    prior.log_scale_sigma = std::max(prior.log_scale_sigma, kSearchSigma);
  }
  predict_profile(std::exp(prior.log_scale), prior);
  return prior;
}

void RoadScale::count(const std::vector<RoadLandmark>& landmarks,
                      const Rigid3& motion,
                      const RoadPrior& road,
                      RoadEvidence& evidence) const {
  const RoadRegion region(motion, road, options_);
  const RoadWarp warp(motion, road, options_.camera_height_m);
  for (const RoadLandmark& landmark : landmarks) {
    const Eigen::Vector3d ray = landmark.in_camera / landmark.in_camera.z();
    const double on_plane = warp.inverse_depth(ray);
    if (!(on_plane > 0.0) || !region.contains(region.on_ground(ray.head<2>()))) {
      continue;
    }
    const double share = 1.0 / (landmark.in_camera.z() * on_plane);
    const double sigma = std::hypot(landmark.sigma * share, kPlaneSigma);
    const double nearer = (share - 1.0) / sigma;
    if (std::abs(nearer) < kOffPlane && sigma > kMaxLandmarkSigma) {
      continue;
    }
    ++(std::abs(nearer) < kOffPlane ? evidence.num_on
       : nearer > 0.0               ? evidence.num_above
                                    : evidence.num_below);
  }
}

RoadScaleEstimate RoadScale::measure(const Past& past,
                                     const RoadImage& image,
                                     ScaleFilter& filter,
                                     const std::vector<RoadLandmark>& landmarks) {
  const RoadPrior predicted = make_prior(past.now_from_past, filter);
  RoadPrior prior = predicted;
  const RoadStep step{past.image, image, past.now_from_past, prior, options_};
  RoadMeasurement dense = no_road("", false);
  RoadMeasurement points = no_road("", false);
  const bool asks_dense = options_.use_dense || !filter.is_initialized();
  if (asks_dense) {  // the corners cannot search for a scale
    dense = measure_dense(step);
  }
  if (options_.use_points) {
    if (dense.is_valid) {
      prior.log_scale = dense.log_scale;  // where to look, not what to find
    }
    points = measure_points(step);
  }
  const Joined joined = join(dense, points, options_.flatness_sigma);
  RoadEvidence evidence;
  evidence.is_in_sight = dense.is_in_sight || (points.is_in_sight && !asks_dense);
  evidence.measured_share = static_cast<double>(joined.num) /
                            ((asks_dense ? 1.0 : 0.0) + (options_.use_points ? 1.0 : 0.0));
  prior = predicted;
  if (joined.num > 0) {
    evidence.innovation = filter.innovation(joined.log_scale, joined.sigma);
    const RoadMeasurement& best = dense.is_valid ? dense : points;
    const Eigen::Vector2d profile(best.slope_rad - prior.slope_rad, best.drop - prior.drop);
    evidence.profile_chi2 = profile.dot(prior.profile_information * profile);
    evidence.roll_chi2 = std::pow((best.roll_rad - prior.roll_rad) / prior.roll_sigma, 2);
    if (dense.is_valid) {
      evidence.correlation = dense.correlation;
    }
    prior.log_scale = joined.log_scale;
    prior.slope_rad = best.slope_rad;
    prior.roll_rad = best.roll_rad;
    prior.drop = best.drop;
  }
  count(landmarks, past.now_from_past, prior, evidence);
  evidence.travelled = path_.front().norm() * std::exp(prior.log_scale) / options_.camera_height_m;
  belief_.add(evidence);
  const bool is_near =
      joined.num > 0 && filter.update(joined.log_scale, joined.sigma, ScaleWitness::kRoad);
  frames_unmeasured_ = is_near ? 0 : frames_unmeasured_ + 1;
  RoadScaleEstimate result;
  if (joined.num == 0) {
    result.reason = options_.use_dense ? dense.reason : points.reason;
    return result;
  }
  result.log_scale = {joined.log_scale, joined.sigma};
  result.is_measured = is_near && belief_.is_believed();
  result.reason = !is_near             ? "differs from the frames before"
                  : result.is_measured ? ""
                                       : belief_.doubt();
  return result;
}

RoadScaleEstimate RoadScale::update(RoadImage image,
                                    const Rigid3& cur_from_prev,
                                    ScaleFilter& filter,
                                    const std::vector<RoadLandmark>& landmarks) {
  if (!past_.empty() && cur_from_prev.translation.norm() > 0.0) {
    for (Eigen::Vector3d& position : path_) {
      position = cur_from_prev * position;
    }
    path_.push_front(cur_from_prev.translation);
    path_.resize(std::min(path_.size(), kMaxPositions));
  }
  for (Past& past : past_) {
    past.now_from_past = cur_from_prev * past.now_from_past;
  }
  RoadScaleEstimate result;
  const Past* past = pick_past(filter);
  if (past != nullptr) {
    result = measure(*past, image, filter, landmarks);
    remember(std::move(image));
  } else if (past_.empty()) {
    result.reason = "first frame";
    remember(std::move(image));
  } else {
    result.reason = "standing still";
  }
  result.is_believed = belief_.is_believed();
  return result;
}

}  // namespace stemvo
