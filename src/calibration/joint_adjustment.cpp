// SPDX-License-Identifier: MIT
#include "calibration/joint_adjustment.hpp"

#include <algorithm>
#include <limits>
#include <memory>
#include <span>

#include <ceres/ceres.h>

#include "calibration/information.hpp"

namespace stemvo::calibration {
namespace {

using Cost = ceres::AutoDiffCostFunction<SharedCameraCost, 2, kNumShared, 4, 3, 4>;

/// The numbers of all segments in one array: Ceres eliminates blocks in the order of their
/// addresses, which must not depend on where segments happen to lie in memory.
class Numbers {
 public:
  Numbers(std::span<const Segment> segments, const SharedVector& shared) {
    std::size_t size = kNumShared;
    for (const Segment& segment : segments) {
      landmarks_.push_back(size);
      size += 4 * segment.landmarks.size();
      poses_.push_back(size);
      size += 7 * segment.camera_from_first.size();
    }
    values_.resize(size);
    std::copy_n(shared.data(), kNumShared, values_.data());
    for (std::size_t s = 0; s < segments.size(); ++s) {
      for (std::size_t i = 0; i < segments[s].landmarks.size(); ++i) {
        std::copy_n(segments[s].landmarks[i].point.data(), 4, landmark(s, i));
      }
      for (std::size_t k = 0; k < segments[s].camera_from_first.size(); ++k) {
        const Rigid3& pose = segments[s].camera_from_first[k];
        std::copy_n(pose.rotation.coeffs().data(), 4, rotation(s, k));
        std::copy_n(pose.translation.data(), 3, translation(s, k));
      }
    }
  }
  double* shared() { return values_.data(); }
  double* landmark(std::size_t s, std::size_t i) { return &values_[landmarks_[s] + 4 * i]; }
  double* rotation(std::size_t s, std::size_t k) { return &values_[poses_[s] + 7 * k]; }
  double* translation(std::size_t s, std::size_t k) { return rotation(s, k) + 4; }

  void write_back(std::span<Segment> segments, SharedVector& shared_out) {
    std::copy_n(shared(), kNumShared, shared_out.data());
    for (std::size_t s = 0; s < segments.size(); ++s) {
      for (std::size_t i = 0; i < segments[s].landmarks.size(); ++i) {
        segments[s].landmarks[i].point = Eigen::Map<const Eigen::Vector4d>(landmark(s, i));
      }
      for (std::size_t k = 0; k < segments[s].camera_from_first.size(); ++k) {
        segments[s].camera_from_first[k] =
            Rigid3(Eigen::Quaterniond(Eigen::Map<const Eigen::Quaterniond>(rotation(s, k))),
                   Eigen::Map<const Eigen::Vector3d>(translation(s, k)));
      }
    }
  }

 private:
  std::vector<double> values_;
  std::vector<std::size_t> landmarks_;  ///< per segment: where they begin
  std::vector<std::size_t> poses_;
};

/// A Ceres problem over numbers, with what it needs to live.
struct Problem {
  Problem(std::span<const Segment> segments, const SharedVector& shared, double loss_scale_px)
      : numbers(segments, shared), loss(loss_scale_px), problem(ownership()) {}
  static ceres::Problem::Options ownership() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  Numbers numbers;
  ceres::CauchyLoss loss;
  ceres::EigenQuaternionManifold quaternions;
  ceres::SphereManifold<4> homogeneous;
  std::array<ceres::SubsetManifold, 3> without_axis = {
      ceres::SubsetManifold(3, {0}), ceres::SubsetManifold(3, {1}), ceres::SubsetManifold(3, {2})};
  std::unique_ptr<ceres::SubsetManifold> free_shared;
  ceres::Problem problem;
};

/// The first keyframe and one coordinate of the last one stay: the gauge.
void fix_gauge(const Segment& segment, std::size_t s, Problem& all) {
  for (std::size_t k = 0; k < segment.camera_from_first.size(); ++k) {
    double* rotation = all.numbers.rotation(s, k);
    double* translation = all.numbers.translation(s, k);
    if (!all.problem.HasParameterBlock(translation)) {
      continue;
    }
    all.problem.SetManifold(rotation, &all.quaternions);
    if (k == 0) {
      all.problem.SetParameterBlockConstant(rotation);
      all.problem.SetParameterBlockConstant(translation);
    } else if (k + 1 == segment.camera_from_first.size()) {
      Eigen::Index longest = 0;
      segment.camera_from_first[k].translation.cwiseAbs().maxCoeff(&longest);
      all.problem.SetManifold(translation, &all.without_axis[static_cast<std::size_t>(longest)]);
    }
  }
}

/// Residuals in order of landmarks, then of their observations.
std::vector<ceres::ResidualBlockId> add_segment(const Segment& segment,
                                                std::size_t s,
                                                const Camera& given,
                                                Problem& all) {
  const Eigen::Vector2d focal_share = focal_shares(given);
  std::vector<ceres::ResidualBlockId> residuals;
  for (std::size_t i = 0; i < segment.landmarks.size(); ++i) {
    double* point = all.numbers.landmark(s, i);
    for (const Observation& seen : segment.landmarks[i].observations) {
      const auto k = static_cast<std::size_t>(seen.keyframe);
      residuals.push_back(all.problem.AddResidualBlock(
          new Cost(new SharedCameraCost{focal_share, seen.uv}), &all.loss, all.numbers.shared(),
          all.numbers.rotation(s, k), all.numbers.translation(s, k), point));
    }
    if (all.problem.HasParameterBlock(point)) {
      all.problem.SetManifold(point, &all.homogeneous);
    }
  }
  fix_gauge(segment, s, all);
  return residuals;
}

void hold_shared(const SharedMask& is_free, Problem& all) {
  std::vector<int> held;
  for (int i = 0; i < kNumShared; ++i) {
    if (!is_free[static_cast<std::size_t>(i)]) {
      held.push_back(i);
    }
  }
  if (static_cast<int>(held.size()) == kNumShared) {
    all.problem.SetParameterBlockConstant(all.numbers.shared());
  } else if (!held.empty()) {
    all.free_shared = std::make_unique<ceres::SubsetManifold>(kNumShared, held);
    all.problem.SetManifold(all.numbers.shared(), all.free_shared.get());
  }
}

/// Landmarks are eliminated first.
std::shared_ptr<ceres::ParameterBlockOrdering> order(std::span<const Segment> segments,
                                                     Problem& all) {
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  const auto add = [&](double* block, int group) {
    if (all.problem.HasParameterBlock(block)) {
      ordering->AddElementToGroup(block, group);
    }
  };
  for (std::size_t s = 0; s < segments.size(); ++s) {
    for (std::size_t i = 0; i < segments[s].landmarks.size(); ++i) {
      add(all.numbers.landmark(s, i), 0);
    }
    for (std::size_t k = 0; k < segments[s].camera_from_first.size(); ++k) {
      add(all.numbers.rotation(s, k), 1);
      add(all.numbers.translation(s, k), 1);
    }
  }
  add(all.numbers.shared(), 1);
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
  Problem all(segments_, shared_, options.loss_scale_px);
  for (std::size_t s = 0; s < segments_.size(); ++s) {
    add_segment(segments_[s], s, given_, all);
  }
  if (all.problem.NumResidualBlocks() == 0) {
    return false;
  }
  hold_shared(options.is_free, all);
  StopCallback stop(callback);
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_SCHUR;
  solver.linear_solver_ordering = order(segments_, all);
  solver.max_num_iterations = options.max_iterations;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  solver.function_tolerance = options.tolerance;
  solver.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &all.problem, &summary);
  if (summary.IsSolutionUsable()) {
    all.numbers.write_back(segments_, shared_);
  }
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
  for (const Segment& segment : segments_) {
    if (segment.landmarks.empty()) {
      continue;
    }
    Problem all(std::span(&segment, 1), shared_, loss_scale_px);
    ceres::Problem::EvaluateOptions evaluation;
    evaluation.residual_blocks = add_segment(segment, 0, given_, all);
    for (std::size_t i = 0; i < segment.landmarks.size(); ++i) {
      evaluation.parameter_blocks.push_back(all.numbers.landmark(0, i));
    }
    for (std::size_t k = 1; k < segment.camera_from_first.size(); ++k) {
      if (all.problem.HasParameterBlock(all.numbers.translation(0, k))) {
        evaluation.parameter_blocks.push_back(all.numbers.rotation(0, k));
        evaluation.parameter_blocks.push_back(all.numbers.translation(0, k));
      }
    }
    evaluation.parameter_blocks.push_back(all.numbers.shared());
    std::vector<double> residuals;
    ceres::CRSMatrix jacobian;
    if (all.problem.Evaluate(evaluation, nullptr, &residuals, nullptr, &jacobian)) {
      result.push_back(eliminate(segment, residuals, jacobian));
    }
  }
  return result;
}

}  // namespace stemvo::calibration
