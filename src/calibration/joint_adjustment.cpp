// SPDX-License-Identifier: MIT
#include "calibration/joint_adjustment.hpp"

#include <limits>
#include <memory>

#include <Eigen/SparseCholesky>
#include <ceres/ceres.h>

namespace stemvo::calibration {
namespace {

constexpr double kMinDepth = 1e-6;
constexpr double kTolerance = 1e-6;  ///< relative change of the cost
constexpr std::size_t kMinObservations = 3;

/// Reprojection error (px) of a homogeneous landmark. Parameters: the shared camera,
/// camera_from_first as unit quaternion (x, y, z, w) and translation, the point.
struct Residual {
  Eigen::Vector2d focal_share;
  Eigen::Vector2d uv;

  template <typename T>
  bool operator()(
      const T* shared, const T* rotation, const T* translation, const T* point, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(rotation);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(translation);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> direction(point);
    const Eigen::Matrix<T, 3, 1> x = q * direction + point[3] * t;
    if (!(x.z() > T(kMinDepth))) {
      return false;  // the solver takes a shorter step
    }
    Eigen::Map<Eigen::Matrix<T, 2, 1>> error(residual);
    error = project_shared(focal_share, shared, x) - uv.template cast<T>();
    return true;
  }
};
using Cost = ceres::AutoDiffCostFunction<Residual, 2, kNumShared, 4, 3, 4>;

void hold_shared(const SharedMask& is_free, double* shared, ceres::Problem& problem) {
  std::vector<int> held;
  for (int i = 0; i < kNumShared; ++i) {
    if (!is_free[static_cast<std::size_t>(i)]) {
      held.push_back(i);
    }
  }
  if (static_cast<int>(held.size()) == kNumShared) {
    problem.SetParameterBlockConstant(shared);
  } else if (!held.empty()) {
    problem.SetManifold(shared, new ceres::SubsetManifold(kNumShared, held));
  }
}

class StopCallback : public ceres::IterationCallback {
 public:
  explicit StopCallback(const JointAdjustment::Callback& callback) : callback_(callback) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*summary*/) override {
    return callback_() ? ceres::SOLVER_CONTINUE : ceres::SOLVER_ABORT;
  }

 private:
  const JointAdjustment::Callback& callback_;
};

/// The Jacobian of the shared numbers, which come last, with what the others explain taken out:
/// the Schur complement's factor (Triggs et al., "Bundle adjustment - a modern synthesis", 6).
Eigen::MatrixXd without_the_rest(const ceres::CRSMatrix& rows) {
  using Sparse = Eigen::SparseMatrix<double>;
  const Sparse jacobian = Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
      rows.num_rows, rows.num_cols, static_cast<Eigen::Index>(rows.values.size()), rows.rows.data(),
      rows.cols.data(), rows.values.data());
  const Sparse rest = jacobian.leftCols(jacobian.cols() - kNumShared);
  const Eigen::MatrixXd shared = jacobian.rightCols(kNumShared);
  Sparse normal = rest.transpose() * rest;
  // Directions that nothing is known of (a landmark without parallax) stay invertible.
  constexpr double kDamping = 1e-12;
  normal.diagonal() *= 1.0 + kDamping;
  return shared - rest * Eigen::SimplicialLDLT<Sparse>(normal).solve(rest.transpose() * shared);
}

}  // namespace

JointAdjustment::JointAdjustment(const std::vector<Segment>& segments, const Camera& given)
    : shared(shared_of(given)), focal_share_(focal_shares(given)) {
  for (const Segment& segment : segments) {
    const int first = static_cast<int>(poses_.size());
    poses_.insert(poses_.end(), segment.camera_from_first.begin(), segment.camera_from_first.end());
    ends_.push_back(poses_.size());
    for (Landmark landmark : segment.landmarks) {
      for (Observation& seen : landmark.observations) {
        seen.keyframe += first;
      }
      landmarks_.push_back(std::move(landmark));
    }
  }
}

std::vector<ceres::ResidualBlockId> JointAdjustment::build(double loss_scale_px,
                                                           ceres::Problem& problem) {
  std::vector<ceres::ResidualBlockId> residuals;
  for (Landmark& landmark : landmarks_) {
    for (const Observation& seen : landmark.observations) {
      Rigid3& pose = poses_[static_cast<std::size_t>(seen.keyframe)];
      residuals.push_back(problem.AddResidualBlock(new Cost(new Residual{focal_share_, seen.uv}),
                                                   new ceres::CauchyLoss(loss_scale_px),
                                                   shared.data(), pose.rotation.coeffs().data(),
                                                   pose.translation.data(), landmark.point.data()));
    }
    problem.SetManifold(landmark.point.data(), new ceres::SphereManifold<4>);
  }
  std::size_t begin = 0;
  for (const std::size_t end : ends_) {
    for (std::size_t k = begin; k < end; ++k) {
      double* rotation = poses_[k].rotation.coeffs().data();
      double* translation = poses_[k].translation.data();
      if (!problem.HasParameterBlock(translation)) {
        continue;
      }
      problem.SetManifold(rotation, new ceres::EigenQuaternionManifold);
      if (k == begin) {
        problem.SetParameterBlockConstant(rotation);
        problem.SetParameterBlockConstant(translation);
      } else if (k + 1 == end) {
        int longest = 0;
        poses_[k].translation.cwiseAbs().maxCoeff(&longest);
        problem.SetManifold(translation, new ceres::SubsetManifold(3, {longest}));
      }
    }
    begin = end;
  }
  return residuals;
}

std::vector<double*> JointAdjustment::pose_blocks(const ceres::Problem& problem) {
  std::vector<double*> blocks;
  for (Rigid3& pose : poses_) {
    for (double* block : {pose.rotation.coeffs().data(), pose.translation.data()}) {
      if (problem.HasParameterBlock(block) && !problem.IsParameterBlockConstant(block)) {
        blocks.push_back(block);
      }
    }
  }
  return blocks;
}

void JointAdjustment::solve(const SharedMask& is_free,
                            double loss_scale_px,
                            const Callback& callback) {
  ceres::Problem problem;
  if (build(loss_scale_px, problem).empty()) {
    return;
  }
  hold_shared(is_free, shared.data(), problem);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (Landmark& landmark : landmarks_) {
    ordering->AddElementToGroup(landmark.point.data(), 0);  // eliminated first
  }
  for (double* block : pose_blocks(problem)) {
    ordering->AddElementToGroup(block, 1);
  }
  ordering->AddElementToGroup(shared.data(), 2);
  StopCallback stop(callback);
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_SCHUR;
  solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = kMaxIterations;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  solver.function_tolerance = kTolerance;
  solver.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  for (Rigid3& pose : poses_) {
    pose.rotation.normalize();
  }
}

double JointAdjustment::error_px(const Landmark& landmark, const Observation& seen) const {
  const Eigen::Vector3d x =
      in_camera(poses_[static_cast<std::size_t>(seen.keyframe)], landmark.point);
  if (!(x.z() > kMinDepth)) {
    return std::numeric_limits<double>::infinity();
  }
  return (project_shared<double>(focal_share_, shared.data(), x) - seen.uv).norm();
}

std::vector<double> JointAdjustment::errors_px() const {
  std::vector<double> errors;
  for (const Landmark& landmark : landmarks_) {
    for (const Observation& seen : landmark.observations) {
      errors.push_back(error_px(landmark, seen));
    }
  }
  return errors;
}

void JointAdjustment::reject_outliers(double bound_px) {
  for (Landmark& landmark : landmarks_) {
    std::erase_if(landmark.observations,
                  [&](const Observation& seen) { return !(error_px(landmark, seen) <= bound_px); });
  }
  std::erase_if(landmarks_, [](const Landmark& landmark) {
    return landmark.observations.size() < kMinObservations;
  });
}

SharedInformation JointAdjustment::information(double loss_scale_px) {
  ceres::Problem problem;
  ceres::Problem::EvaluateOptions evaluation;
  evaluation.residual_blocks = build(loss_scale_px, problem);
  for (Landmark& landmark : landmarks_) {
    evaluation.parameter_blocks.push_back(landmark.point.data());
  }
  const std::vector<double*> poses = pose_blocks(problem);
  evaluation.parameter_blocks.insert(evaluation.parameter_blocks.end(), poses.begin(), poses.end());
  evaluation.parameter_blocks.push_back(shared.data());
  std::vector<double> residuals;
  ceres::CRSMatrix rows;
  SharedInformation result;
  if (landmarks_.empty() || !problem.Evaluate(evaluation, nullptr, &residuals, nullptr, &rows)) {
    return result;
  }
  const Eigen::MatrixXd jacobian = without_the_rest(rows);
  result.hessian = jacobian.transpose() * jacobian;
  Eigen::Index row = 0;
  std::size_t segment = 0;
  result.gradients.resize(ends_.size(), SharedVector::Zero());
  for (const Landmark& landmark : landmarks_) {
    while (static_cast<std::size_t>(landmark.observations.front().keyframe) >= ends_[segment]) {
      ++segment;
    }
    for (std::size_t i = 0; i < 2 * landmark.observations.size(); ++i, ++row) {
      result.gradients[segment] +=
          residuals[static_cast<std::size_t>(row)] * jacobian.row(row).transpose();
    }
  }
  return result;
}

double JointAdjustment::turned_rad() const {
  double sum = 0.0;
  auto begin = poses_.begin();
  for (const std::size_t end : ends_) {
    const auto behind = poses_.begin() + static_cast<std::ptrdiff_t>(end);
    sum += calibration::turned_rad({begin, behind});
    begin = behind;
  }
  return sum;
}

}  // namespace stemvo::calibration
