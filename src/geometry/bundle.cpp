// SPDX-License-Identifier: MIT
#include "geometry/bundle.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "geometry/cauchy_loss.hpp"

namespace stemvo {
namespace {

using Matrix23 = Eigen::Matrix<double, 2, 3>;
using Matrix63 = Eigen::Matrix<double, 6, 3>;
using Matrix26 = Eigen::Matrix<double, 2, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kMinDepth = 1e-6;
constexpr int kCamera = 5;  ///< unknowns of the camera
using Matrix25 = Eigen::Matrix<double, 2, kCamera>;

/// Where a pose sees a point, and how far from its observation.
struct Reprojection {
  Reprojection(const Bundle& bundle,
               const Bundle::Observation& observation,
               const Eigen::Matrix3d& rotation)
      : camera(bundle.camera), radial(bundle.radial) {
    x = rotation * bundle.points[static_cast<std::size_t>(observation.point)] +
        bundle.camera_from_world[static_cast<std::size_t>(observation.pose)].translation;
    u = x.x() / x.z();
    v = x.y() / x.z();
    r_sq = u * u + v * v;
    stretch = 1.0 + r_sq * (radial[0] + radial[1] * r_sq);
    error = Eigen::Vector2d(camera.fx_px * u * stretch + camera.cx_px,
                            camera.fy_px * v * stretch + camera.cy_px) -
            observation.uv;
  }
  [[nodiscard]] Matrix23 by_x() const;
  [[nodiscard]] Matrix25 by_camera() const;

  const Camera& camera;
  const Eigen::Vector2d& radial;
  Eigen::Vector3d x;  ///< the point in the camera
  double u = 0.0;     ///< its ray
  double v = 0.0;
  double r_sq = 0.0;
  double stretch = 1.0;   ///< of the ray, by the radial distortion
  Eigen::Vector2d error;  ///< px
};

Matrix23 Reprojection::by_x() const {
  const double bend = 2.0 * (radial[0] + 2.0 * radial[1] * r_sq);
  Eigen::Matrix2d by_ray;
  by_ray << camera.fx_px * (stretch + bend * u * u), camera.fx_px * bend * u * v,
      camera.fy_px * bend * u * v, camera.fy_px * (stretch + bend * v * v);
  Matrix23 ray_by_x;
  ray_by_x << 1.0, 0.0, -u, 0.0, 1.0, -v;
  return by_ray * ray_by_x / x.z();
}

Matrix25 Reprojection::by_camera() const {
  Matrix25 result;
  result << 1.0, 0.0, camera.fx_px * u * stretch, camera.fx_px * u * r_sq,
      camera.fx_px * u * r_sq * r_sq,  //
      0.0, 1.0, camera.fy_px * v * stretch, camera.fy_px * v * r_sq, camera.fy_px * v * r_sq * r_sq;
  return result;
}

std::vector<Eigen::Matrix3d> rotations_of(const Bundle& bundle) {
  std::vector<Eigen::Matrix3d> rotations;
  for (const Rigid3& pose : bundle.camera_from_world) {
    rotations.push_back(pose.rotation_matrix());
  }
  return rotations;
}

/// The normal equations in blocks. A point's part is damped and eliminated at once.
class NormalEquations {
 public:
  NormalEquations(const Bundle& bundle, const BundleOptions& options)
      : options_(options),
        num_camera_(options.camera ? kCamera : 0),
        size_(6 * (static_cast<int>(bundle.camera_from_world.size()) - options.num_fixed_poses) +
              num_camera_),
        reduced_(size_, size_),
        gradient_(size_),
        points_(bundle.points.size()),
        by_pose_(bundle.observations.size()) {}

  /// Around the bundle, with the points' blocks damped.
  void linearize(const Bundle& bundle, double damping);
  /// Moves `bundle` by the solution; false where there is none.
  [[nodiscard]] bool step(double damping,
                          const CameraChange& from_prior,
                          Bundle& bundle,
                          CameraChange& camera_change) const;
  [[nodiscard]] CameraInformation camera_information() const;

 private:
  struct PointBlock {
    Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    Eigen::Matrix<double, kCamera, 3> by_camera = Eigen::Matrix<double, kCamera, 3>::Zero();
  };
  /// An observation of a pose with this rotation.
  void add(const Bundle& bundle, std::size_t i, const Eigen::Matrix3d& rotation);
  void eliminate(const Bundle& bundle, std::size_t begin, std::size_t end, double damping);
  [[nodiscard]] int row_of(const Bundle::Observation& observation) const {
    return num_camera_ + 6 * (observation.pose - options_.num_fixed_poses);
  }

  BundleOptions options_;
  int num_camera_;
  int size_;
  Eigen::MatrixXd reduced_;  ///< camera first, then the free poses; upper triangle
  Eigen::VectorXd gradient_;
  Eigen::VectorXd diagonal_;  ///< before the elimination
  std::vector<PointBlock> points_;
  std::vector<Matrix63> by_pose_;  ///< of each observation
};

void move_camera(const CameraChange& change, Bundle& bundle) {
  bundle.camera.cx_px += change[0];
  bundle.camera.cy_px += change[1];
  bundle.camera.fx_px *= 1.0 + change[2];
  bundle.camera.fy_px *= 1.0 + change[2];
  bundle.radial += change.tail<2>();
}

/// The observations of a point, [begin, end).
template <typename Use>
void for_each_point(const Bundle& bundle, const Use& use) {
  const auto& all = bundle.observations;
  for (std::size_t begin = 0; begin < all.size();) {
    std::size_t end = begin + 1;
    while (end < all.size() && all[end].point == all[begin].point) {
      ++end;
    }
    use(begin, end);
    begin = end;
  }
}

void NormalEquations::linearize(const Bundle& bundle, double damping) {
  reduced_.setZero();
  gradient_.setZero();
  std::fill(points_.begin(), points_.end(), PointBlock());
  const std::vector<Eigen::Matrix3d> rotations = rotations_of(bundle);
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    const auto pose = static_cast<std::size_t>(bundle.observations[i].pose);
    add(bundle, i, rotations[pose]);
  }
  diagonal_ = reduced_.diagonal();
  for_each_point(
      bundle, [&](std::size_t begin, std::size_t end) { eliminate(bundle, begin, end, damping); });
}

void NormalEquations::add(const Bundle& bundle, std::size_t i, const Eigen::Matrix3d& rotation) {
  const Bundle::Observation& observation = bundle.observations[i];
  const Reprojection at(bundle, observation, rotation);
  const double weight = CauchyLoss(options_.loss_scale_px).weight(at.error.squaredNorm());
  const Matrix23 by_x = at.by_x();
  const Matrix23 by_point = by_x * rotation;
  PointBlock& point = points_[static_cast<std::size_t>(observation.point)];
  point.inverse += weight * by_point.transpose() * by_point;
  point.gradient += weight * by_point.transpose() * at.error;
  Matrix25 by_camera;
  if (num_camera_ > 0) {
    by_camera = at.by_camera();
    point.by_camera += weight * by_camera.transpose() * by_point;
    reduced_.topLeftCorner<kCamera, kCamera>() += weight * by_camera.transpose() * by_camera;
    gradient_.head<kCamera>() += weight * by_camera.transpose() * at.error;
  }
  if (observation.pose < options_.num_fixed_poses) {
    return;
  }
  Matrix26 by_pose;  // x' = exp(w) x + t
  by_pose << -by_x * skew(at.x), by_x;
  const int row = row_of(observation);
  by_pose_[i] = weight * by_pose.transpose() * by_point;
  reduced_.block<6, 6>(row, row) += weight * by_pose.transpose() * by_pose;
  gradient_.segment<6>(row) += weight * by_pose.transpose() * at.error;
  if (num_camera_ > 0) {
    reduced_.block<kCamera, 6>(0, row) += weight * by_camera.transpose() * by_pose;
  }
}

void NormalEquations::eliminate(const Bundle& bundle,
                                std::size_t begin,
                                std::size_t end,
                                double damping) {
  PointBlock& point = points_[static_cast<std::size_t>(bundle.observations[begin].point)];
  point.inverse.diagonal() *= 1.0 + damping;
  point.inverse = point.inverse.inverse().eval();
  if (num_camera_ > 0) {
    const Eigen::Matrix<double, kCamera, 3> scaled = point.by_camera * point.inverse;
    reduced_.topLeftCorner<kCamera, kCamera>() -= scaled * point.by_camera.transpose();
    gradient_.head<kCamera>() -= scaled * point.gradient;
  }
  for (std::size_t i = begin; i < end; ++i) {
    if (bundle.observations[i].pose < options_.num_fixed_poses) {
      continue;
    }
    const int row = row_of(bundle.observations[i]);
    const Matrix63 scaled = by_pose_[i] * point.inverse;
    gradient_.segment<6>(row) -= scaled * point.gradient;
    if (num_camera_ > 0) {
      reduced_.block<kCamera, 6>(0, row) -= point.by_camera * scaled.transpose();
    }
    for (std::size_t j = begin; j < end; ++j) {
      if (bundle.observations[j].pose >= bundle.observations[i].pose) {
        reduced_.block<6, 6>(row, row_of(bundle.observations[j])) -=
            scaled * by_pose_[j].transpose();
      }
    }
  }
}

bool NormalEquations::step(double damping,
                           const CameraChange& from_prior,
                           Bundle& bundle,
                           CameraChange& camera_change) const {
  Eigen::MatrixXd damped = reduced_;
  Eigen::VectorXd gradient = gradient_;
  damped.diagonal() += damping * diagonal_;
  if (num_camera_ > 0) {
    damped.topLeftCorner<kCamera, kCamera>() += options_.camera->information;
    gradient.head<kCamera>() += options_.camera->information * from_prior;
  }
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Upper> solver(damped);
  const Eigen::VectorXd change = -solver.solve(gradient);
  if (solver.info() != Eigen::Success || !change.allFinite()) {
    return false;
  }
  for_each_point(bundle, [&](std::size_t begin, std::size_t end) {
    const auto index = static_cast<std::size_t>(bundle.observations[begin].point);
    const PointBlock& point = points_[index];
    Eigen::Vector3d rest = point.gradient;
    if (num_camera_ > 0) {
      rest += point.by_camera.transpose() * change.head<kCamera>();
    }
    for (std::size_t i = begin; i < end; ++i) {
      if (bundle.observations[i].pose >= options_.num_fixed_poses) {
        rest += by_pose_[i].transpose() * change.segment<6>(row_of(bundle.observations[i]));
      }
    }
    bundle.points[index] -= point.inverse * rest;
  });
  for (std::size_t i = static_cast<std::size_t>(options_.num_fixed_poses);
       i < bundle.camera_from_world.size(); ++i) {
    const Vector6 of_pose =
        change.segment<6>(num_camera_ + 6 * (static_cast<int>(i) - options_.num_fixed_poses));
    const Eigen::Quaterniond turn = so3_exp(of_pose.head<3>());
    Rigid3& pose = bundle.camera_from_world[i];
    pose = Rigid3(turn * pose.rotation, turn * pose.translation + of_pose.tail<3>());
  }
  if (num_camera_ > 0) {
    camera_change = change.head<kCamera>();
    move_camera(camera_change, bundle);
  }
  return true;
}

CameraInformation NormalEquations::camera_information() const {
  const int rest = size_ - num_camera_;
  Eigen::MatrixXd poses = reduced_.bottomRightCorner(rest, rest);
  poses.diagonal() += 1e-9 * diagonal_.tail(rest);  // lengths may be free
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Upper> solver(poses);
  if (solver.info() != Eigen::Success) {
    return CameraInformation::Zero();
  }
  const Eigen::MatrixXd mixed = reduced_.topRightCorner(num_camera_, rest);
  const CameraInformation information =
      reduced_.topLeftCorner<kCamera, kCamera>() - mixed * solver.solve(mixed.transpose());
  return 0.5 * (information + information.transpose());
}

/// Infinite where a point is behind a pose that sees it.
double cost_of(const Bundle& bundle, double loss_scale_px) {
  const std::vector<Eigen::Matrix3d> rotations = rotations_of(bundle);
  CauchyLoss loss(loss_scale_px);
  for (const Bundle::Observation& observation : bundle.observations) {
    const Reprojection at(bundle, observation,
                          rotations[static_cast<std::size_t>(observation.pose)]);
    if (!(at.x.z() > kMinDepth)) {
      return std::numeric_limits<double>::infinity();
    }
    loss.add(at.error.squaredNorm());
  }
  return loss.sum();
}

}  // namespace

BundleResult adjust_bundle(Bundle& bundle, const BundleOptions& options) {
  BundleResult result;
  const auto prior_cost = [&](const CameraChange& change) {
    const CameraChange off = options.camera ? CameraChange(change - options.camera->mean) : change;
    return options.camera ? off.dot(options.camera->information * off) : 0.0;
  };
  result.cost = cost_of(bundle, options.loss_scale_px) + prior_cost(result.camera_change);
  if (static_cast<int>(bundle.camera_from_world.size()) <= options.num_fixed_poses ||
      !std::isfinite(result.cost)) {
    return result;
  }
  NormalEquations equations(bundle, options);
  double damping = 1e-4;
  for (int i = 0; i < options.max_iterations && damping < 1e4; ++i) {
    equations.linearize(bundle, damping);
    Bundle trial = bundle;
    CameraChange change = CameraChange::Zero();
    const CameraChange from_prior =
        options.camera ? CameraChange(result.camera_change - options.camera->mean) : change;
    const bool is_solved = equations.step(damping, from_prior, trial, change);
    change = composed(result.camera_change, change);
    const double cost = is_solved ? cost_of(trial, options.loss_scale_px) + prior_cost(change)
                                  : std::numeric_limits<double>::infinity();
    if (!(cost < result.cost)) {
      damping *= 10.0;
      continue;
    }
    const double decrease = result.cost - cost;
    bundle = std::move(trial);
    result.is_usable = true;
    result.cost = cost;
    result.camera_change = change;
    damping = std::max(damping / 3.0, 1e-10);
    if (decrease < options.min_relative_decrease * cost) {
      break;
    }
  }
  if (options.camera) {
    equations.linearize(bundle, 1e-9);  // so that a point far away still has an inverse
    result.information = equations.camera_information();
  }
  return result;
}

}  // namespace stemvo
