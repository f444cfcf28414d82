// SPDX-License-Identifier: MIT
#include "odometry/self_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// Prior of the given camera: principal point (px), focal length (share), k1, k2.
constexpr double kPriorSigma[] = {10.0, 10.0, 0.003, 0.01, 0.005};
/// Prior where the focal length is asked for as well: the given one may be another camera's.
constexpr double kWeakPriorSigma[] = {30.0, 30.0, 0.03, 0.02, 0.01};
/// Errors of a track's points are alike: a run tells less than as many independent ones would.
constexpr double kSigmaFactorSq = 2.0 * 2.0;
/// Forward motion biases all tracks the same way: without this factor focal lengths that are known
/// were missed by 3.3 sigmas on drives (03, a rendered one), by 0.8 with the camera in the hand.
constexpr double kFocalSigmaFactor = 3.0;
/// An unknown is believed under this sigma, px, ..
constexpr double kMaxSigma_px = 1.5;
constexpr double kMaxSigmaOfFocal = 0.01;
/// .. where it leaves the given value by more than so many sigmas, ..
constexpr double kMinSigmas = 2.0;
/// .. to which this is added in squares, px: however many runs there are, tracks bend alike in
/// turns to one side, and a true principal point is missed by 0.6 to 0.7 px until the road turns
/// back.
constexpr double kBias_px = 0.3;
/// The camera moves by this at a keyframe: the window can follow.
constexpr double kMaxStep_px = 0.25;
/// .. and its lens moves the image's sides by this: while it is not right, lengths drift in turns.
constexpr double kMaxLensStep_px = 3.0;

/// The numbers are finite and the information is positive.
bool is_plausible(const CameraMeasurement& found) {
  const Eigen::Map<const IntrinsicsDelta> scale(kPriorSigma);
  const CameraInformation scaled = scale.asDiagonal() * found.information * scale.asDiagonal();
  return scaled.allFinite() && found.change.allFinite() &&
         Eigen::SelfAdjointEigenSolver<CameraInformation>(scaled).eigenvalues().minCoeff() > -1e-3;
}

}  // namespace

std::optional<IntrinsicsDelta> prior_sigma(CameraRefinement refinement) {
  if (refinement == CameraRefinement::kOff) {
    return std::nullopt;
  }
  return Eigen::Map<const IntrinsicsDelta>(refinement == CameraRefinement::kAll ? kWeakPriorSigma
                                                                                : kPriorSigma);
}

SelfCalibration::SelfCalibration(const Camera& given,
                                 CameraRefinement refinement,
                                 bool may_begin_threads)
    : given_(given),
      camera_(given),
      refinement_(refinement),
      may_begin_threads_(may_begin_threads) {
  const IntrinsicsDelta sigma = prior_sigma(refinement).value_or(IntrinsicsDelta::Ones());
  information_ = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
}

void SelfCalibration::begin_with(const KeptKeyframe& of_map) {
  constexpr double kMaxOfFocal = 0.01;
  constexpr double kMaxCenter_px = 10.0;
  constexpr double kMinSide_px = 2.0;  // of a lens that was certain
  const Camera& other = of_map.camera;
  const bool is_same =
      other.width_px == given_.width_px && other.height_px == given_.height_px &&
      std::abs(other.fx_px / given_.fx_px - 1.0) < kMaxOfFocal &&
      std::abs(other.fy_px / given_.fy_px - 1.0) < kMaxOfFocal &&
      std::hypot(other.cx_px - given_.cx_px, other.cy_px - given_.cy_px) < kMaxCenter_px;
  if (refinement_ == CameraRefinement::kOff || !is_same ||
      std::abs(side_px().dot(of_map.radial)) < kMinSide_px) {
    return;
  }
  radial_ = of_map.radial;
  mean_ = applied();
  target_ = mean_;
  const Eigen::Vector2d sigma(0.003, 0.0015);
  information_.diagonal().tail<2>() = sigma.cwiseAbs2().cwiseInverse();
}

IntrinsicsDelta SelfCalibration::sigma() const {
  IntrinsicsDelta sigma = information_.inverse().diagonal().cwiseSqrt();
  sigma[2] *= kFocalSigmaFactor;
  return sigma;
}

void SelfCalibration::observe(const Keyframe& keyframe,
                              const Eigen::Vector2d& radial,
                              const BundleOptions& options) {
  if (refinement_ == CameraRefinement::kOff) {
    return;
  }
  fuse_result();
  approach_target();
  run_.keyframes.push_back(keyframe);
  free_again(radial_lens(camera_, radial), run_.keyframes.back().points);
  triangulate_landmarks(run_, camera_, {});
  if (static_cast<int>(run_.keyframes.size()) == kNumKeyframes) {
    begin_measuring(options);
  }
}

void SelfCalibration::begin_measuring(const BundleOptions& options) {
  const CameraPrior prior{difference(mean_, applied()), kSigmaFactorSq * information_};
  const auto task = [run = std::move(run_), camera = camera_, prior, options] {
    return timed(Stage::kCamera, [&] { return measure_camera(run, camera, prior, options); });
  };
  const auto where =
      may_begin_threads_ ? std::launch::async | std::launch::deferred : std::launch::deferred;
  measured_ = std::async(where, task).share();  // moved, it is gone where no thread could begin
  run_ = {};
}

void SelfCalibration::fuse_result() {
  const Measured measured = std::exchange(measured_, {});
  const auto found = measured.valid() ? measured.get() : std::nullopt;
  if (!found.has_value() || !is_plausible(*found)) {
    return;
  }
  mean_ = compose(applied(), found->change);
  information_ += found->information / kSigmaFactorSq;
  ++num_runs_;
  const IntrinsicsDelta sigmas = sigma();
  const auto insists = [](double mean, double sigma, double max, double bias) {
    return sigma < max && std::abs(mean) > kMinSigmas * std::hypot(sigma, bias);
  };
  target_.setZero();
  for (const int i : {0, 1}) {
    target_[i] = insists(mean_[i], sigmas[i], kMaxSigma_px, kBias_px) ? mean_[i] : 0.0;
  }
  // k1 and k2 are told together only: what they do to the image's side is asked.
  const Eigen::Vector2d side = side_px();
  const Eigen::Matrix2d covariance = information_.inverse().bottomRightCorner<2, 2>();
  if (insists(side.dot(mean_.tail<2>()), std::sqrt(side.dot(covariance * side)), kMaxSigma_px,
              kBias_px)) {
    target_.tail<2>() = mean_.tail<2>();
  }
  if (refinement_ == CameraRefinement::kAll &&
      insists(mean_[2], sigmas[2], kMaxSigmaOfFocal, 0.0)) {
    target_[2] = mean_[2];
  }
}

void SelfCalibration::approach_target() {
  const IntrinsicsDelta left = target_ - applied();
  const auto step = [&](int i, double max) { return std::clamp(left[i], -max, max); };
  camera_.cx_px += step(0, kMaxStep_px);
  camera_.cy_px += step(1, kMaxStep_px);
  const double focal = step(2, kMaxStep_px / given_.mean_focal_px());
  camera_.fx_px += focal * given_.fx_px;
  camera_.fy_px += focal * given_.fy_px;
  if (const Eigen::Vector2d of_lens = left.tail<2>(); !of_lens.isZero()) {
    const RadialLens before = lens();
    radial_ += std::min(1.0, kMaxLensStep_px / std::abs(side_px().dot(of_lens))) * of_lens;
    for (Keyframe& keyframe : run_.keyframes) {  // so that the run is measured as one
      free_again(before, keyframe.points);
    }
  }
}

void SelfCalibration::free_again(const RadialLens& before, Observations& points) const {
  if (before.k != radial_) {
    for (Observation& point : points) {
      point.uv = lens().undistort(before.distort(point.uv));
    }
  }
}

Eigen::Vector2d SelfCalibration::side_px() const {
  const double half_px = std::max(given_.cx_px, given_.width_px - given_.cx_px);
  const double r_sq = std::pow(half_px / given_.fx_px, 2);
  return half_px * Eigen::Vector2d(r_sq, r_sq * r_sq);
}

}  // namespace stemvo
