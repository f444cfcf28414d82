// SPDX-License-Identifier: MIT
#include "calibration/joint_adjustment.hpp"

#include <limits>
#include <memory>

#include <ceres/ceres.h>

#include "calibration/information.hpp"

namespace stemvo::calibration {
namespace {

using Cost = ceres::AutoDiffCostFunction<SharedCameraCost, 2, kNumShared, 4, 3, 4>;

/// A Ceres problem with what it needs to live. The blocks are the segments' own memory.
struct Problem {
  explicit Problem(double loss_scale_px) : loss(loss_scale_px) {
    ceres::Problem::Options ownership;
    ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem = std::make_unique<ceres::Problem>(ownership);
  }
  ceres::CauchyLoss loss;
  ceres::EigenQuaternionManifold quaternions;
  ceres::SphereManifold<4> homogeneous;
  std::array<std::unique_ptr<ceres::SubsetManifold>, 3> without_axis = {
      std::make_unique<ceres::SubsetManifold>(3, std::vector<int>{0}),
      std::make_unique<ceres::SubsetManifold>(3, std::vector<int>{1}),
      std::make_unique<ceres::SubsetManifold>(3, std::vector<int>{2})};
  std::unique_ptr<ceres::SubsetManifold> free_shared;
  std::unique_ptr<ceres::Problem> problem;
};

/// Residuals in order of landmarks, then of their observations.
std::vector<ceres::ResidualBlockId> add_segment(Segment& segment,
                                                const Camera& given,
                                                SharedVector& shared,
                                                Problem& all) {
  const Eigen::Vector2d focal_share = focal_shares(given);
  std::vector<ceres::ResidualBlockId> residuals;
  for (Landmark& landmark : segment.landmarks) {
    for (const Observation& seen : landmark.observations) {
      Rigid3& pose = segment.camera_from_first[static_cast<std::size_t>(seen.keyframe)];
      residuals.push_back(all.problem->AddResidualBlock(
          new Cost(new SharedCameraCost{focal_share, seen.uv}), &all.loss, shared.data(),
          pose.rotation.coeffs().data(), pose.translation.data(), landmark.point.data()));
    }
    if (!landmark.observations.empty()) {
      all.problem->SetManifold(landmark.point.data(), &all.homogeneous);
    }
  }
  for (std::size_t k = 0; k < segment.camera_from_first.size(); ++k) {
    Rigid3& pose = segment.camera_from_first[k];
    if (!all.problem->HasParameterBlock(pose.translation.data())) {
      continue;
    }
    all.problem->SetManifold(pose.rotation.coeffs().data(), &all.quaternions);
    if (k == 0) {
      all.problem->SetParameterBlockConstant(pose.rotation.coeffs().data());
      all.problem->SetParameterBlockConstant(pose.translation.data());
    } else if (k + 1 == segment.camera_from_first.size()) {
      Eigen::Index longest = 0;
      pose.translation.cwiseAbs().maxCoeff(&longest);
      all.problem->SetManifold(pose.translation.data(),
                               all.without_axis[static_cast<std::size_t>(longest)].get());
    }
  }
  return residuals;
}

void hold_shared(const SharedMask& is_free, SharedVector& shared, Problem& all) {
  std::vector<int> held;
  for (int i = 0; i < kNumShared; ++i) {
    if (!is_free[static_cast<std::size_t>(i)]) {
      held.push_back(i);
    }
  }
  if (static_cast<int>(held.size()) == kNumShared) {
    all.problem->SetParameterBlockConstant(shared.data());
  } else if (!held.empty()) {
    all.free_shared = std::make_unique<ceres::SubsetManifold>(kNumShared, held);
    all.problem->SetManifold(shared.data(), all.free_shared.get());
  }
}

/// Landmarks first, then the poses, the shared numbers last: an arrow that stays sparse.
std::shared_ptr<ceres::ParameterBlockOrdering> order(std::vector<Segment>& segments,
                                                     SharedVector& shared,
                                                     const ceres::Problem& problem) {
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  const auto add = [&](double* block, int group) {
    if (problem.HasParameterBlock(block)) {
      ordering->AddElementToGroup(block, group);
    }
  };
  for (Segment& segment : segments) {
    for (Landmark& landmark : segment.landmarks) {
      add(landmark.point.data(), 0);
    }
    for (Rigid3& pose : segment.camera_from_first) {
      add(pose.rotation.coeffs().data(), 1);
      add(pose.translation.data(), 1);
    }
  }
  add(shared.data(), 1);
  return ordering;
}

class StopCallback : public ceres::IterationCallback {
 public:
  explicit StopCallback(const JointAdjustment::Callback& callback) : callback_(callback) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*summary*/) override {
    return !callback_ || callback_() ? ceres::SOLVER_CONTINUE : ceres::SOLVER_ABORT;
  }

 private:
  const JointAdjustment::Callback& callback_;
};

}  // namespace

bool JointAdjustment::solve(const AdjustmentOptions& options, const Callback& callback) {
  Problem all(options.loss_scale_px);
  for (Segment& segment : segments_) {
    add_segment(segment, given_, shared_, all);
  }
  if (all.problem->NumResidualBlocks() == 0) {
    return false;
  }
  hold_shared(options.is_free, shared_, all);
  StopCallback stop(callback);
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_SCHUR;
  solver.linear_solver_ordering = order(segments_, shared_, *all.problem);
  solver.max_num_iterations = options.max_iterations;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  solver.function_tolerance = options.tolerance;
  solver.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, all.problem.get(), &summary);
  return summary.IsSolutionUsable();
}

double JointAdjustment::error_px(const Segment& segment,
                                 const Landmark& landmark,
                                 const Observation& seen) const {
  const Eigen::Vector3d x = in_keyframe(segment, seen.keyframe, landmark.point);
  if (!(x.z() > 1e-6)) {
    return std::numeric_limits<double>::infinity();
  }
  return (project_shared<double>(focal_shares(given_), shared_.data(), x) - seen.uv).norm();
}

std::vector<SegmentInformation> JointAdjustment::information(double loss_scale_px) {
  std::vector<SegmentInformation> result;
  for (Segment& segment : segments_) {
    if (segment.landmarks.empty()) {
      continue;
    }
    Problem all(loss_scale_px);
    ceres::Problem::EvaluateOptions evaluation;
    evaluation.residual_blocks = add_segment(segment, given_, shared_, all);
    for (Landmark& landmark : segment.landmarks) {
      evaluation.parameter_blocks.push_back(landmark.point.data());
    }
    for (std::size_t k = 1; k < segment.camera_from_first.size(); ++k) {
      Rigid3& pose = segment.camera_from_first[k];
      if (all.problem->HasParameterBlock(pose.translation.data())) {
        evaluation.parameter_blocks.push_back(pose.rotation.coeffs().data());
        evaluation.parameter_blocks.push_back(pose.translation.data());
      }
    }
    evaluation.parameter_blocks.push_back(shared_.data());
    std::vector<double> residuals;
    ceres::CRSMatrix jacobian;
    if (!all.problem->Evaluate(evaluation, nullptr, &residuals, nullptr, &jacobian)) {
      result.emplace_back();
      continue;
    }
    result.push_back(eliminate(segment, residuals, jacobian));
  }
  return result;
}

}  // namespace stemvo::calibration
