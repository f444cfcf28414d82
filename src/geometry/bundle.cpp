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
#include "internal_check.hpp"

namespace stemvo {
namespace {

using Matrix32 = Eigen::Matrix<double, 3, 2>;
using Matrix63 = Eigen::Matrix<double, 6, 3>;
using Matrix62 = Eigen::Matrix<double, 6, 2>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kMinBundleDepth = 1e-6;
/// More keeps the first steps from where the data hardly pull: where the window bends, and the
/// camera. With 1e-4 ten steps end half-way there.
constexpr double kFirstDamping = 1e-7;
constexpr int kCamera = 5;  ///< unknowns of the camera
using Matrix52 = Eigen::Matrix<double, kCamera, 2>;

/// Where a pose sees a point, and how far from its observation.
struct Reprojection {
  Reprojection(const Bundle& bundle,
               const Bundle::Observation& observation,
               const Eigen::Matrix3d& rotation) {
    x = rotation * bundle.points[static_cast<std::size_t>(observation.point)] +
        bundle.camera_from_world[static_cast<std::size_t>(observation.pose)].translation;
    inverse_z = 1.0 / x.z();
    u = x.x() * inverse_z;
    v = x.y() * inverse_z;
    r_sq = u * u + v * v;
    stretch = 1.0 + r_sq * (bundle.radial[0] + bundle.radial[1] * r_sq);
    error = Eigen::Vector2d(bundle.camera.fx_px * u * stretch + bundle.camera.cx_px,
                            bundle.camera.fy_px * v * stretch + bundle.camera.cy_px) -
            observation.uv;
  }
  /// Transposed Jacobians.
  [[nodiscard]] Matrix32 by_x(const Bundle& bundle) const;
  [[nodiscard]] Matrix52 by_camera(const Camera& camera) const;

  Eigen::Vector3d x;  ///< the point in the camera
  double inverse_z = 0.0;
  double u = 0.0;  ///< its ray
  double v = 0.0;
  double r_sq = 0.0;
  double stretch = 1.0;   ///< of the ray, by the radial distortion
  Eigen::Vector2d error;  ///< px
  double weight = 1.0;    ///< of the robust loss
};

Matrix32 Reprojection::by_x(const Bundle& bundle) const {
  const Eigen::Vector2d& radial = bundle.radial;
  const double bend = 2.0 * (radial[0] + 2.0 * radial[1] * r_sq);
  const double fx = bundle.camera.fx_px * inverse_z;
  const double fy = bundle.camera.fy_px * inverse_z;
  const double uu = stretch + bend * u * u;
  const double uv = bend * u * v;
  const double vv = stretch + bend * v * v;
  Matrix32 result;
  result << fx * uu, fy * uv, fx * uv, fy * vv, -fx * (uu * u + uv * v), -fy * (uv * u + vv * v);
  return result;
}

Matrix52 Reprojection::by_camera(const Camera& camera) const {
  const double fu = camera.fx_px * u;
  const double fv = camera.fy_px * v;
  Matrix52 result;
  result << 1.0, 0.0, 0.0, 1.0, fu * stretch, fv * stretch, fu * r_sq, fv * r_sq, fu * r_sq * r_sq,
      fv * r_sq * r_sq;
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
class BundleEquations {
 public:
  BundleEquations(const Bundle& bundle, const BundleOptions& options)
      : options_(options),
        num_camera_(options.camera ? kCamera : 0),
        size_(6 * (static_cast<int>(bundle.camera_from_world.size()) - options.num_fixed_poses) +
              num_camera_),
        reduced_(size_, size_),
        gradient_(size_),
        points_(bundle.points.size()),
        by_pose_(bundle.observations.size()) {}

  /// Around the bundle, with the points' blocks damped.
  void linearize(const Bundle& bundle, const std::vector<Reprojection>& at, double damping);
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
  void add(const Bundle& bundle,
           std::size_t i,
           const Reprojection& at,
           const Eigen::Matrix3d& rotation,
           PointBlock& point);
  void eliminate(
      const Bundle& bundle, std::size_t begin, std::size_t end, double damping, PointBlock& point);
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

void BundleEquations::linearize(const Bundle& bundle,
                                const std::vector<Reprojection>& at,
                                double damping) {
  reduced_.setZero();
  gradient_.setZero();
  diagonal_.setZero(size_);
  const std::vector<Eigen::Matrix3d> rotations = rotations_of(bundle);
  for_each_point(bundle, [&](std::size_t begin, std::size_t end) {
    PointBlock& point = points_[static_cast<std::size_t>(bundle.observations[begin].point)];
    point = PointBlock();
    for (std::size_t i = begin; i < end; ++i) {
      add(bundle, i, at[i], rotations[static_cast<std::size_t>(bundle.observations[i].pose)],
          point);
    }
    eliminate(bundle, begin, end, damping, point);
  });
}

void BundleEquations::add(const Bundle& bundle,
                          std::size_t i,
                          const Reprojection& at,
                          const Eigen::Matrix3d& rotation,
                          PointBlock& point) {
  const Bundle::Observation& observation = bundle.observations[i];
  const double weight = at.weight;
  const Matrix32 by_x = at.by_x(bundle);
  const Matrix32 by_point = rotation.transpose() * by_x;
  const Matrix32 weighted = weight * by_point;
  point.inverse.noalias() += weighted * by_point.transpose();
  point.gradient.noalias() += weighted * at.error;
  const bool is_free = observation.pose >= options_.num_fixed_poses;
  Matrix62 by_pose;  // x' = exp(w) x + t
  if (is_free) {
    by_pose << at.x.cross(by_x.col(0)), at.x.cross(by_x.col(1)), by_x;
    const int row = row_of(observation);
    by_pose_[i].noalias() = by_pose * weighted.transpose();
    const Matrix62 weighted_pose = weight * by_pose;
    reduced_.block<6, 6>(row, row).noalias() += weighted_pose * by_pose.transpose();
    diagonal_.segment<6>(row) += weighted_pose.cwiseProduct(by_pose).rowwise().sum();
    gradient_.segment<6>(row).noalias() += weighted_pose * at.error;
  }
  if (num_camera_ > 0) {
    const Matrix52 by_camera = at.by_camera(bundle.camera);
    const Matrix52 weighted_camera = weight * by_camera;
    point.by_camera.noalias() += weighted_camera * by_point.transpose();
    reduced_.topLeftCorner<kCamera, kCamera>().noalias() += weighted_camera * by_camera.transpose();
    diagonal_.head<kCamera>() += weighted_camera.cwiseProduct(by_camera).rowwise().sum();
    gradient_.head<kCamera>().noalias() += weighted_camera * at.error;
    if (is_free) {
      reduced_.block<kCamera, 6>(0, row_of(observation)).noalias() +=
          weighted_camera * by_pose.transpose();
    }
  }
}

void BundleEquations::eliminate(
    const Bundle& bundle, std::size_t begin, std::size_t end, double damping, PointBlock& point) {
  point.inverse.diagonal() *= 1.0 + damping;
  point.inverse = point.inverse.inverse().eval();
  if (num_camera_ > 0) {
    const Eigen::Matrix<double, kCamera, 3> scaled = point.by_camera * point.inverse;
    reduced_.topLeftCorner<kCamera, kCamera>().noalias() -= scaled * point.by_camera.transpose();
    gradient_.head<kCamera>().noalias() -= scaled * point.gradient;
  }
  for (std::size_t i = begin; i < end; ++i) {
    if (bundle.observations[i].pose < options_.num_fixed_poses) {
      continue;
    }
    const int row = row_of(bundle.observations[i]);
    Matrix63 scaled;
    scaled.noalias() = by_pose_[i] * point.inverse;
    gradient_.segment<6>(row).noalias() -= scaled * point.gradient;
    if (num_camera_ > 0) {
      reduced_.block<kCamera, 6>(0, row).noalias() -= point.by_camera * scaled.transpose();
    }
    for (std::size_t j = i; j < end; ++j) {
      reduced_.block<6, 6>(row, row_of(bundle.observations[j])).noalias() -=
          scaled * by_pose_[j].transpose();
    }
  }
}

bool BundleEquations::step(double damping,
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

CameraInformation BundleEquations::camera_information() const {
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

/// Every observation under the bundle, and the robust cost: infinite where a point is behind a pose
/// that sees it.
double reproject(const Bundle& bundle, double loss_scale_px, std::vector<Reprojection>& result) {
  const std::vector<Eigen::Matrix3d> rotations = rotations_of(bundle);
  result.clear();
  CauchyLoss loss(loss_scale_px);
  for (const Bundle::Observation& observation : bundle.observations) {
    Reprojection& at = result.emplace_back(bundle, observation,
                                           rotations[static_cast<std::size_t>(observation.pose)]);
    if (!(at.x.z() > kMinBundleDepth)) {
      return std::numeric_limits<double>::infinity();
    }
    at.weight = loss.add(at.error.squaredNorm());
  }
  return loss.sum();
}

}  // namespace

BundleResult adjust_bundle(Bundle& bundle, const BundleOptions& options) {
  const auto place = [](const Bundle::Observation& observation) {
    return std::pair(observation.point, observation.pose);
  };
  STEMVO_CHECK(std::ranges::adjacent_find(bundle.observations, std::ranges::greater_equal{},
                                          place) == bundle.observations.end(),
               "observations are ordered by point, then by pose, and none comes twice");
  BundleResult result;
  const auto prior_cost = [&](const CameraChange& change) {
    const CameraChange off = options.camera ? CameraChange(change - options.camera->mean) : change;
    return options.camera ? off.dot(options.camera->information * off) : 0.0;
  };
  std::vector<Reprojection> at;
  at.reserve(bundle.observations.size());
  result.cost = reproject(bundle, options.loss_scale_px, at) + prior_cost(result.camera_change);
  if (static_cast<int>(bundle.camera_from_world.size()) <= options.num_fixed_poses ||
      !std::isfinite(result.cost)) {
    return result;
  }
  BundleEquations equations(bundle, options);
  std::vector<Reprojection> trial_at;
  trial_at.reserve(at.size());
  BundleState before;
  double damping = kFirstDamping;
  for (int i = 0; i < options.max_iterations && damping < 1e4; ++i) {
    equations.linearize(bundle, at, damping);
    before = static_cast<const BundleState&>(bundle);
    CameraChange change = CameraChange::Zero();
    const CameraChange from_prior =
        options.camera ? CameraChange(result.camera_change - options.camera->mean) : change;
    const bool is_solved = equations.step(damping, from_prior, bundle, change);
    change = composed(result.camera_change, change);
    const double cost =
        is_solved ? reproject(bundle, options.loss_scale_px, trial_at) + prior_cost(change)
                  : std::numeric_limits<double>::infinity();
    if (!(cost < result.cost)) {
      static_cast<BundleState&>(bundle) = before;
      damping *= 10.0;
      continue;
    }
    const double decrease = result.cost - cost;
    at.swap(trial_at);
    result.is_usable = true;
    result.cost = cost;
    result.camera_change = change;
    damping = std::max(damping / 3.0, 1e-10);
    if (decrease < options.min_relative_decrease * cost) {
      break;
    }
  }
  if (options.camera) {
    equations.linearize(bundle, at, 1e-9);  // so that a point far away still has an inverse
    result.information = equations.camera_information();
  }
  return result;
}

}  // namespace stemvo
