// SPDX-License-Identifier: MIT
#include "mapping/map_adjustment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <memory>
#include <utility>

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include "geometry/median.hpp"
#include "geometry/radial_lens.hpp"
#include "mapping/adjustment_errors.hpp"
#include "mapping/pose_graph.hpp"

namespace stemvo {
namespace {

/// Two keyframes with fewer landmarks in common are held by their motion as well, and loops with
/// fewer corners by theirs.
constexpr int kFewLandmarks = 15;
/// Most observations of a map; beyond, the shortest tracks are left out.
constexpr std::size_t kMaxObservations = 40'000;
constexpr std::size_t kMinOfKeyframe = 60;
/// Least Cauchy scale, px, and over the median error, as in the window.
constexpr double kMinLoss_px = 0.2;
constexpr double kLossShare = 2.0;
constexpr double kLooseLoop = 3.0;
constexpr double kMinSigma_px = 0.01;
/// Errors of a track's corners are alike, and in forward motion those of all tracks: where the
/// tracks that begin in so many keyframes are off together, they count as one error.
constexpr int kKeyframesOfCluster = 8;
constexpr int kMaxClusters = 40;
/// Clusters are alike, too, where the motion stays the same.
constexpr double kLikeErrors = 2.0;

ceres::Problem::Options shared_losses() {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;
  return options;
}

/// The unknowns of a map and Ceres's problem of them. `map` and `options` outlive it.
class Adjustment {
 public:
  Adjustment(const KeptMap& map, const MapAdjustmentOptions& options)
      : map_(map), options_(options), problem_(shared_losses()) {
    for (const Similarity3& at : map.map_from_keyframe) {
      poses_.emplace_back(Rigid3(at.rotation, at.translation).inverse());
    }
    if (options.camera_sigma) {
      const KeptKeyframe& last = map.keyframes.back();
      camera_ = {last.camera.cx_px - options.camera.cx_px, last.camera.cy_px - options.camera.cy_px,
                 last.camera.fx_px / options.camera.fx_px - 1.0, last.radial[0], last.radial[1]};
    }
    place_points();
    add_corners();
    add_edges();
    add_lengths();
    add_camera();
    if (problem_.HasParameterBlock(poses_.front().delta.data())) {
      problem_.SetParameterBlockConstant(poses_.front().delta.data());
    }
  }

  bool solve() {
    if (points_.empty() || !minimize(1e-3, 15) ||
        !minimize(options_.max_views > 0 ? 1e-4 : 1e-6, 50)) {
      return false;
    }
    measure_errors(1.0);
    return true;
  }

  [[nodiscard]] MapAdjustment result() {
    MapAdjustment result;
    result.median_error_px = median_error_px_;
    result.camera.change = Eigen::Map<const IntrinsicsDelta>(camera_.data());
    result.camera.num_bundles = 1;
    read_landmarks(result);
    read_poses(result);
    if (options_.has_sigmas && (options_.camera_sigma || !options_.covariance_of.empty())) {
      read_covariances(result);
    }
    return result;
  }

 private:
  [[nodiscard]] const Camera& base_camera(int keyframe) const {
    return keyframe < options_.num_of_other_camera ? map_.keyframes[slot(keyframe)].camera
                                                   : options_.camera;
  }
  [[nodiscard]] double* camera_change(int keyframe) {
    return keyframe < options_.num_of_other_camera ? no_change_.data() : camera_.data();
  }
  [[nodiscard]] Eigen::Vector2d uv(const MapView& view) const {
    return map_.keyframes[slot(view.keyframe)].corners[slot(view.corner)].uv.cast<double>();
  }
  /// As the frame has it: the lens is an unknown. Another recording's stays as it was found.
  [[nodiscard]] Eigen::Vector2d frame_uv(const MapView& view) const {
    const KeptKeyframe& keyframe = map_.keyframes[slot(view.keyframe)];
    return view.keyframe < options_.num_of_other_camera
               ? uv(view)
               : radial_lens(keyframe.camera, keyframe.radial).distort(uv(view));
  }

  [[nodiscard]] Eigen::Vector2d ray(const MapView& view) {
    const Camera& camera = base_camera(view.keyframe);
    const double* change = camera_change(view.keyframe);
    return camera.normalize(uv(view) - Eigen::Vector2d(change[0], change[1])) / (1.0 + change[2]);
  }

  void place_points() {
    const std::size_t share = std::max(kMinOfKeyframe, kMaxObservations / map_.keyframes.size());
    for (MapTrack& track :
         choose_tracks(tracks_of(map_), map_.keyframes.size(), share, options_.max_views)) {
      std::vector<Eigen::Vector2d> rays;
      std::ranges::transform(track, std::back_inserter(rays),
                             [&](const MapView& view) { return ray(view); });
      if (AdjustedPoint point; triangulate(poses_, track, rays, point)) {
        points_.push_back(point);
        tracks_.push_back(std::move(track));
      }
    }
  }

  void add_corners() {
    const auto num_keyframes = static_cast<int>(poses_.size());
    const int num_clusters = std::clamp(num_keyframes / kKeyframesOfCluster, 2, kMaxClusters);
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      for (const MapView& view : tracks_[i]) {
        AdjustedPose& pose = poses_[slot(view.keyframe)];
        auto* error = new CornerError(frame_uv(view), base_camera(view.keyframe), points_[i], pose,
                                      sigma_px_);
        residuals_.push_back(
            {problem_.AddResidualBlock(error, &corner_loss_, points_[i].at.data(),
                                       pose.delta.data(), camera_change(view.keyframe)),
             tracks_[i].front().keyframe * num_clusters / num_keyframes});
      }
    }
  }

  void add_edges() {
    std::vector<int> num_common(map_.keyframes.size());  // with the next keyframe
    for (const MapTrack& track : tracks_) {
      for (std::size_t i = 0; i + 1 < track.size(); ++i) {
        num_common[slot(track[i].keyframe)] += track[i].keyframe + 1 == track[i + 1].keyframe;
      }
    }
    const auto add_edge = [&](const MapEdge& edge, ceres::LossFunction* loss) {
      add<6>(EdgeError(edge, map_.pose(edge.from).scale, poses_[slot(edge.from)],
                       poses_[slot(edge.to)]),
             edge.from, edge.to, loss);
    };
    for (const MapEdge& edge : map_.motions) {
      if (edge.from + 1 != edge.to || num_common[slot(edge.from)] < kFewLandmarks) {
        add_edge(edge, nullptr);
      }
    }
    for (const Loop& loop : map_.loops) {
      if (num_common_landmarks(loop) < kFewLandmarks) {
        add_edge(loop, &loop_loss_);
      }
    }
  }

  void add_lengths() {
    std::vector<const MapEdge*> motion_from(map_.keyframes.size());
    for (const MapEdge& edge : map_.motions) {
      motion_from[slot(edge.from)] = &edge;
    }
    const auto add_distance = [&](int from, int to, double log_distance, double sigma) {
      add<1>(DistanceError{poses_[slot(from)], poses_[slot(to)], log_distance, sigma}, from, to);
    };
    for (std::size_t i = 0; i < map_.lengths.size(); ++i) {
      const MapLength& length = map_.lengths[i];
      const MapEdge* edge = motion_from[slot(length.keyframe)];
      const double distance = edge == nullptr ? 0.0 : edge->from_to.translation.norm();
      if (edge != nullptr && distance > 3.0 * edge->sigma_translation) {
        add_distance(edge->from, edge->to, std::log(distance) + length.log_metres_per_unit,
                     independent_sigma(map_, i));
      }
    }
    if (map_.lengths.empty()) {
      // Any length, so that there is a scale.
      const std::vector<Similarity3>& at = map_.map_from_keyframe;
      const auto distance_from_first = [&](const Similarity3& other) {
        return (other.translation - at.front().translation).norm();
      };
      const auto far = std::ranges::max_element(at, {}, distance_from_first);
      if (const double distance = distance_from_first(*far); distance > 0.0) {
        add_distance(0, static_cast<int>(far - at.begin()), std::log(distance), 1e-3);
      }
    }
  }

  void add_camera() {
    problem_.AddParameterBlock(camera_.data(), 6);
    problem_.AddParameterBlock(no_change_.data(), 6);
    problem_.SetParameterBlockConstant(no_change_.data());
    if (!options_.camera_sigma) {
      problem_.SetParameterBlockConstant(camera_.data());
      return;
    }
    Eigen::Matrix<double, 6, 1> information;
    information << options_.camera_sigma->cwiseInverse(), 1.0;
    residuals_.push_back({problem_.AddResidualBlock(
        new ceres::NormalPrior(information.asDiagonal().toDenseMatrix(), Eigen::VectorXd::Zero(6)),
        nullptr, camera_.data())});
  }

  template <int kSize, typename Error>
  void add(const Error& error, int from, int to, ceres::LossFunction* loss = nullptr) {
    residuals_.push_back({problem_.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Error, kSize, 6, 6>(new Error(error)), loss,
        poses_[slot(from)].delta.data(), poses_[slot(to)].delta.data())});
  }

  [[nodiscard]] int num_common_landmarks(const MapEdge& edge) const {
    const auto sees = [](const MapTrack& track, int keyframe) {
      return std::ranges::binary_search(track, keyframe, {}, &MapView::keyframe);
    };
    return static_cast<int>(std::ranges::count_if(tracks_, [&](const MapTrack& track) {
      return sees(track, edge.from) && sees(track, edge.to);
    }));
  }

  void measure_errors(double sigma_factor) {
    std::vector<double> errors;
    errors.reserve(residuals_.size());
    for (const ClusteredResidual& residual : residuals_) {
      if (residual.cluster >= 0) {  // a corner's
        Eigen::Vector2d error;
        double cost = 0.0;
        problem_.EvaluateResidualBlock(residual.block, false, &cost, error.data(), nullptr);
        errors.push_back(sigma_px_ * error.norm());
      }
    }
    median_error_px_ = median(std::move(errors));
    sigma_px_ = sigma_factor * std::max(median_error_px_ / kMedianOfRayleigh, kMinSigma_px);
    const double loss_px = std::max(kMinLoss_px, kLossShare * median_error_px_);
    corner_loss_.Reset(new ceres::CauchyLoss(loss_px / sigma_px_), ceres::TAKE_OWNERSHIP);
  }

  bool minimize(double tolerance, int max_iterations) {
    measure_errors(std::sqrt(std::max(1.0, static_cast<double>(options_.max_views))));
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_SCHUR;
    if (ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::SUITE_SPARSE)) {
      options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
    }
    options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (AdjustedPoint& point : points_) {
      options.linear_solver_ordering->AddElementToGroup(point.at.data(), 0);
    }
    for (AdjustedPose& pose : poses_) {
      if (problem_.HasParameterBlock(pose.delta.data())) {
        options.linear_solver_ordering->AddElementToGroup(pose.delta.data(), 1);
      }
    }
    options.linear_solver_ordering->AddElementToGroup(camera_.data(), 1);
    options.linear_solver_ordering->AddElementToGroup(no_change_.data(), 1);
    options.function_tolerance = tolerance;
    options.max_num_iterations = max_iterations;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    std::ranges::for_each(poses_, &AdjustedPose::take_in);
    return summary.IsSolutionUsable();
  }

  void read_landmarks(MapAdjustment& result) const {
    for (std::size_t i = 0; i < points_.size(); ++i) {
      AdjustedLandmark& landmark = result.landmarks.emplace_back();
      landmark.in_map = points_[i].in_map();
      landmark.views = tracks_[i];
    }
  }

  void read_poses(MapAdjustment& result) const {
    std::vector<std::vector<double>> growth(poses_.size());  // of lengths, by landmarks' depths
    for (const AdjustedLandmark& landmark : result.landmarks) {
      for (const MapView& view : landmark.views) {
        const KeptCorner& corner = map_.keyframes[slot(view.keyframe)].corners[slot(view.corner)];
        const double depth = (poses_[slot(view.keyframe)].camera_from_map() * landmark.in_map).z();
        if (corner.has_landmark() && depth > 0.0 && corner.in_camera.z() > 0.0F) {
          growth[slot(view.keyframe)].push_back(depth / corner.in_camera.z());
        }
      }
    }
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      const Rigid3 at = poses_[i].camera_from_map().inverse();
      const bool is_known = growth[i].size() >= slot(kFewLandmarks);
      result.map_from_keyframe.emplace_back(
          is_known ? median(std::move(growth[i])) : map_.map_from_keyframe[i].scale, at.rotation,
          at.translation);
    }
  }

  void read_covariances(MapAdjustment& result) {
    std::vector<double*> free;
    std::vector<double*> blocks;
    problem_.GetParameterBlocks(&blocks);
    std::ranges::copy_if(blocks, std::back_inserter(free), [&](const double* block) {
      return !problem_.IsParameterBlockConstant(block);
    });
    std::vector<double*> asked = {camera_.data()};
    for (const int i : options_.covariance_of) {
      asked.push_back(poses_[slot(i)].delta.data());
    }
    const auto found = clustered_covariances(problem_, free, residuals_, asked, kLikeErrors);
    result.camera.sigma = found.front().diagonal().head<5>().cwiseSqrt();
    for (std::size_t i = 0; i < options_.covariance_of.size(); ++i) {
      const AdjustedPose& pose = poses_[slot(options_.covariance_of[i])];
      Eigen::Matrix<double, 6, 6> by_delta;  // of (position, rotation) by (w, v)
      by_delta << -skew(pose.translation), -Eigen::Matrix3d::Identity(),
          -Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero();
      result.covariances.emplace_back(by_delta * found[i + 1] * by_delta.transpose());
    }
  }

  const KeptMap& map_;
  const MapAdjustmentOptions& options_;
  std::vector<AdjustedPose> poses_;  ///< one per keyframe
  std::vector<MapTrack> tracks_;
  std::vector<AdjustedPoint> points_;     ///< one per track
  std::array<double, 6> camera_ = {};     ///< IntrinsicsDelta of options_.camera, and nothing
  std::array<double, 6> no_change_ = {};  ///< of other recordings' cameras
  double median_error_px_ = 0.0;
  double sigma_px_ = 1.0;
  std::vector<ClusteredResidual> residuals_;
  ceres::LossFunctionWrapper corner_loss_{nullptr, ceres::TAKE_OWNERSHIP};
  ceres::CauchyLoss loop_loss_{kLooseLoop};
  ceres::Problem problem_;
};

}  // namespace

std::optional<MapAdjustment> adjust_map(const KeptMap& map, const MapAdjustmentOptions& options) {
  if (map.keyframes.size() < 2) {
    return std::nullopt;
  }
  Adjustment adjustment(map, options);
  return adjustment.solve() ? std::optional(adjustment.result()) : std::nullopt;
}

}  // namespace stemvo
