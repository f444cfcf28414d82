// SPDX-License-Identifier: MIT
#include "geometry/decomposition.hpp"

#include <cmath>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace stemvo {
namespace {

using Svd3 = Eigen::JacobiSVD<Eigen::Matrix3d>;

/// ORB-SLAM2's bound: closer singular values leave the direction of the translation open.
constexpr double kMinRatio = 1.00001;
/// Beyond, d2 is rounding and the matrix has rank 1.
constexpr double kMaxRatio = 1e9;

/// The 8 hypotheses share A = K^-1 H K = U diag(d1, d2, d3) V^T.
struct FaugerasTerms {
  Eigen::Matrix3d u;
  Eigen::Matrix3d v;
  double sign;  ///< det U det V
  double d1;
  double d2;
  double d3;
};

/// Rotation about y of the case d' = +d2 and reflection of the case d' = -d2 (Faugeras & Lustman
/// 1988, eq. 12 to 16); x1 and x3 are the signed parts of the plane's normal.
Rigid3 planar_motion(const FaugerasTerms& f, double x1, double x3, bool d2_positive) {
  const double side = d2_positive ? 1.0 : -1.0;
  const double scale = (f.d1 + side * f.d3) * f.d2;
  const double s = x1 * x3 * (f.d1 * f.d1 - f.d3 * f.d3) / scale;
  const double c = (f.d1 * f.d3 + side * (f.d2 * f.d2)) / scale;
  Eigen::Matrix3d rotation;
  rotation << c, 0.0, -side * s, 0.0, side, 0.0, s, 0.0, side * c;
  const Eigen::Vector3d translation(x1, 0.0, -side * x3);
  return Rigid3::from_matrix(f.sign * f.u * rotation * f.v.transpose(),
                             (f.u * translation).normalized());
}

}  // namespace

std::vector<Rigid3> decompose_homography(const Eigen::Matrix3d& homography, const Camera& camera) {
  const Eigen::Matrix3d k = camera.matrix();
  const Eigen::Matrix3d a = k.inverse() * homography * k;
  const Svd3 svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& d = svd.singularValues();
  // Negated, so that 0/0 is refused as well.
  if (!(d(0) / d(1) >= kMinRatio && d(0) / d(1) <= kMaxRatio && d(1) / d(2) >= kMinRatio)) {
    return {};
  }
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  const FaugerasTerms f{svd.matrixU(), svd.matrixV(), sign, d(0), d(1), d(2)};
  const double range = f.d1 * f.d1 - f.d3 * f.d3;
  const double x1 = std::sqrt((f.d1 * f.d1 - f.d2 * f.d2) / range);
  const double x3 = std::sqrt((f.d2 * f.d2 - f.d3 * f.d3) / range);
  std::vector<Rigid3> hypotheses;
  for (const bool d2_positive : {true, false}) {
    for (const double sign1 : {1.0, -1.0}) {
      for (const double sign3 : {1.0, -1.0}) {
        hypotheses.push_back(planar_motion(f, sign1 * x1, sign3 * x3, d2_positive));
      }
    }
  }
  return hypotheses;
}

std::array<Rigid3, 4> decompose_essential(const Eigen::Matrix3d& essential) {
  const Svd3 svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d w;
  w << 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  const Eigen::Matrix3d& u = svd.matrixU();
  const Eigen::Matrix3d v_t = svd.matrixV().transpose();
  const double sign = u.determinant() * v_t.determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d first = sign * u * w * v_t;
  const Eigen::Matrix3d second = sign * u * w.transpose() * v_t;
  const Eigen::Vector3d t = u.col(2).normalized();
  return {Rigid3::from_matrix(first, t), Rigid3::from_matrix(second, t),
          Rigid3::from_matrix(first, -t), Rigid3::from_matrix(second, -t)};
}

}  // namespace stemvo
