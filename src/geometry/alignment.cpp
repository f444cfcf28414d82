// SPDX-License-Identifier: MIT
#include "geometry/alignment.hpp"

#include <cmath>
#include <cstddef>
#include <numeric>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace stemvo {
namespace {

/// Rounding of the mean leaves a variance of this share of its square where all points are equal.
constexpr double kRounding = 1e-24;

Eigen::Vector3d mean(std::span<const Eigen::Vector3d> points) {
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  return std::accumulate(points.begin(), points.end(), zero) / static_cast<double>(points.size());
}

Similarity3 scale_about_origin(std::span<const Eigen::Vector3d> source,
                               std::span<const Eigen::Vector3d> target) {
  double xy = 0.0;
  double xx = 0.0;
  double yy = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    xy += source[i].dot(target[i]);
    xx += source[i].squaredNorm();
    yy += target[i].squaredNorm();
  }
  Similarity3 result;
  // Opposite directions have no scale, a negative one would mirror the trajectory: then that of one
  // size.
  const double scale = xy > 0.0 ? xy / xx : std::sqrt(yy / xx);
  result.scale = std::isfinite(scale) && scale > 0.0 ? scale : 1.0;
  return result;
}

/// The rotation of an SVD of sum(t s^T). Points on a line leave the turn about it open: then the
/// smallest rotation that lays one line on the other, instead of whatever the SVD happens to give.
Eigen::Matrix3d best_rotation(const Eigen::JacobiSVD<Eigen::Matrix3d>& svd,
                              const Eigen::Vector3d& signs) {
  if (svd.singularValues()(1) <= 1e-12 * svd.singularValues()(0)) {
    return Eigen::Quaterniond::FromTwoVectors(svd.matrixV().col(0), svd.matrixU().col(0))
        .toRotationMatrix();
  }
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

/// Rotation (and scale) of the centred points; Umeyama 1991, eq. (40) to (43).
Similarity3 umeyama(std::span<const Eigen::Vector3d> source,
                    std::span<const Eigen::Vector3d> target,
                    bool with_scale) {
  const Eigen::Vector3d source_mean = mean(source);
  const Eigen::Vector3d target_mean = mean(target);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double source_variance = 0.0;
  double target_variance = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Eigen::Vector3d s = source[i] - source_mean;
    const Eigen::Vector3d t = target[i] - target_mean;
    covariance += t * s.transpose();
    source_variance += s.squaredNorm();
    target_variance += t.squaredNorm();
  }
  Similarity3 result;
  if (!covariance.allFinite()) {
    return result;
  }
  const double count = static_cast<double>(source.size());
  const bool spread = source_variance > kRounding * count * source_mean.squaredNorm() &&
                      target_variance > kRounding * count * target_mean.squaredNorm();
  if (spread) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                                Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d signs = Eigen::Vector3d::Ones();
    if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) {
      signs.z() = -1.0;
    }
    result.rotation = Eigen::Quaterniond(best_rotation(svd, signs)).normalized();
    const double scale = svd.singularValues().dot(signs) / source_variance;
    result.scale = with_scale && scale > 0.0 ? scale : 1.0;
  }
  result.translation = target_mean - result.scale * (result.rotation * source_mean);
  return result;
}

}  // namespace

Similarity3 align_positions(std::span<const Eigen::Vector3d> source,
                            std::span<const Eigen::Vector3d> target,
                            Alignment alignment) {
  if (source.empty() || alignment == Alignment::kNone) {
    return {};
  }
  if (alignment == Alignment::kScale) {
    return scale_about_origin(source, target);
  }
  return umeyama(source, target, alignment == Alignment::kSim3);
}

}  // namespace stemvo
