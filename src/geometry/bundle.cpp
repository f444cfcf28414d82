// SPDX-License-Identifier: MIT
#include "geometry/bundle.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Cholesky>

#include "geometry/minimize.hpp"
#include "geometry/normal_equations.hpp"

namespace stemvo {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kMinBundleDepth = 1e-6;
/// More keeps the first steps from where the data hardly pull: where the window bends, and the
/// camera. With 1e-4 ten steps end half-way there.
constexpr double kFirstDamping = 1e-7;
constexpr int kCamera = NormalEquations::kCamera;

template <std::size_t kColumns>
void copy(const NormalEquations::Block<kColumns>& from,
          int num_rows,
          Eigen::Ref<Eigen::MatrixXd> to) {
  for (std::size_t c = 0; c < kColumns; ++c) {
    for (int r = 0; r < num_rows; ++r) {
      to(r, static_cast<int>(c)) = from[c][r];
    }
  }
}

/// The normal equations without the points: the camera first, then the free poses.
class ReducedEquations {
 public:
  ReducedEquations(const Bundle& bundle, const BundleOptions& options)
      : options_(options),
        num_camera_(options.camera ? kCamera : 0),
        equations_(bundle, options.num_fixed_poses, options.camera.has_value()),
        size_(num_camera_ + 6 * equations_.num_free_poses()),
        reduced_(size_, size_),
        gradient_(size_),
        diagonal_(size_) {}

  /// Around the bundle, with the points' blocks damped.
  void linearize(const Bundle& bundle, const std::vector<Reprojection>& at, double damping) {
    equations_.add_up(bundle, at, damping);
    Eigen::Matrix<double, Eigen::Dynamic, 2> columns(size_, 2);  // gradient, diagonal
    const auto add = [&](const auto& of, int row, int size) {
      copy(NormalEquations::Block<2>{of.gradient, of.diagonal}, size,
           columns.middleRows(row, size));
      copy(of.with_camera, num_camera_, reduced_.block(0, row, num_camera_, size));
    };
    add(equations_.camera, 0, num_camera_);
    for (int j = 0; j < equations_.num_free_poses(); ++j) {
      add(equations_.poses[static_cast<std::size_t>(j)], row_of(j), 6);
      for (int i = 0; i <= j; ++i) {
        copy(equations_.H_pp[equations_.index_of(i, j)], 6,
             reduced_.block<6, 6>(row_of(i), row_of(j)));
      }
    }
    gradient_ = columns.col(0);
    diagonal_ = columns.col(1);
  }

  /// Moves `bundle`, whose camera `so_far` has changed, by the solution; false where there is none.
  [[nodiscard]] bool step(double damping,
                          const IntrinsicsDelta& so_far,
                          Bundle& bundle,
                          IntrinsicsDelta& camera_change) const {
    Eigen::MatrixXd damped = reduced_;
    Eigen::VectorXd gradient = gradient_;
    damped.diagonal() += damping * diagonal_;
    if (num_camera_ > 0) {
      damped.topLeftCorner<kCamera, kCamera>() += options_.camera->information;
      gradient.head<kCamera>() += options_.camera->information * (so_far - options_.camera->mean);
    }
    const Eigen::LLT<Eigen::MatrixXd, Eigen::Upper> solver(damped);
    const Eigen::VectorXd change = -solver.solve(gradient);
    if (solver.info() != Eigen::Success || !change.allFinite()) {
      return false;
    }
    move_points(change, bundle);
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
      bundle.camera = changed(bundle.camera, camera_change);
      bundle.radial += camera_change.tail<2>();
    }
    return true;
  }

  [[nodiscard]] CameraInformation camera_information() const {
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

 private:
  void move_points(const Eigen::VectorXd& change, Bundle& bundle) const {
    const auto times = [](const NormalEquations::Block<3>& block, const auto& by) {
      Eigen::Vector3d result;
      for (std::size_t c = 0; c < block.size(); ++c) {
        double sum = 0.0;
        for (int r = 0; r < by.size(); ++r) {
          sum += block[c][r] * by[r];
        }
        result[static_cast<int>(c)] = sum;
      }
      return result;
    };
    const auto& all = bundle.observations;
    for (std::size_t i = 0; i < all.size();) {
      const auto index = static_cast<std::size_t>(all[i].point);
      const NormalEquations::Point& point = equations_.points[index];
      Eigen::Vector3d rest(point.gradient[0], point.gradient[1], point.gradient[2]);
      if (num_camera_ > 0) {
        rest += times(point.with_camera, change.head<kCamera>());
      }
      for (; i < all.size() && all[i].point == static_cast<int>(index); ++i) {
        if (const int free = all[i].pose - options_.num_fixed_poses; free >= 0) {
          rest += times(equations_.H_pl[i], change.segment<6>(row_of(free)));
        }
      }
      Eigen::Matrix3d inverse;
      for (int c = 0; c < 3; ++c) {
        const NormalEquations::Lanes4& column = point.inverse[c];
        inverse.col(c) << column[0], column[1], column[2];
      }
      bundle.points[index] -= inverse * rest;
    }
  }

  [[nodiscard]] int row_of(int free_pose) const { return num_camera_ + 6 * free_pose; }

  BundleOptions options_;
  int num_camera_;
  NormalEquations equations_;
  int size_;
  Eigen::MatrixXd reduced_;  ///< upper triangle
  Eigen::VectorXd gradient_;
  Eigen::VectorXd diagonal_;  ///< before the elimination
};

/// Every observation under the bundle, and the robust cost: infinite where a point is behind a pose
/// that sees it.
double reproject(const Bundle& bundle, double loss_scale_px, std::vector<Reprojection>& result) {
  std::vector<Eigen::Matrix3d> rotations(bundle.camera_from_world.size());
  std::ranges::transform(bundle.camera_from_world, rotations.begin(), &Rigid3::rotation_matrix);
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

BundleResult solve_bundle_adjustment(Bundle& bundle, const BundleOptions& options) {
  BundleResult result;
  const auto prior_cost = [&](const IntrinsicsDelta& change) {
    const IntrinsicsDelta off =
        options.camera ? IntrinsicsDelta(change - options.camera->mean) : change;
    return options.camera ? off.dot(options.camera->information * off) : 0.0;
  };
  std::vector<Reprojection> at;
  at.reserve(bundle.observations.size());
  result.cost = reproject(bundle, options.loss_scale_px, at) + prior_cost(result.camera_change);
  if (static_cast<int>(bundle.camera_from_world.size()) <= options.num_fixed_poses ||
      !std::isfinite(result.cost)) {
    return result;
  }
  ReducedEquations equations(bundle, options);
  std::vector<Reprojection> trial_at;
  trial_at.reserve(at.size());
  BundleState before;
  double damping = kFirstDamping;
  for (int i = 0; i < options.max_iterations && damping < 1e4; ++i) {
    equations.linearize(bundle, at, damping);
    before = static_cast<const BundleState&>(bundle);
    IntrinsicsDelta change = IntrinsicsDelta::Zero();
    const bool is_solved = equations.step(damping, result.camera_change, bundle, change);
    change = compose(result.camera_change, change);
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
