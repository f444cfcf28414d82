// SPDX-License-Identifier: MIT
#include "geometry/normal_equations.hpp"

#include <algorithm>

#include <Eigen/LU>

#include "instruction_set.hpp"

namespace stemvo {
namespace {

using Lanes4 = NormalEquations::Lanes4;
using Column = NormalEquations::Column;
template <std::size_t kColumns>
using Block = NormalEquations::Block<kColumns>;

/// Columns of J^T, one for each of an observation's two coordinates.
struct Jacobian {
  Column columns[2];
};

STEMVO_INLINE void scale(const Jacobian& by, double weight, Jacobian& result) {
  for (int k = 0; k < 2; ++k) {
    result.columns[k].lo = weight * by.columns[k].lo;
    result.columns[k].hi = weight * by.columns[k].hi;
  }
}

/// sum += a b, for both coordinates.
STEMVO_INLINE void add(const Jacobian& a, double b0, double b1, Column& sum) {
  sum.lo += a.columns[0].lo * b0 + a.columns[1].lo * b1;
  sum.hi += a.columns[0].hi * b0 + a.columns[1].hi * b1;
}

/// sum += a b^T
template <std::size_t kColumns>
STEMVO_INLINE void add(const Jacobian& a, const Jacobian& b, Block<kColumns>& sum) {
  for (std::size_t c = 0; c < kColumns; ++c) {
    const int row = static_cast<int>(c);
    add(a, b.columns[0][row], b.columns[1][row], sum[c]);
  }
}

STEMVO_INLINE void add_diagonal(const Jacobian& a, const Jacobian& b, Column& sum) {
  sum.lo += a.columns[0].lo * b.columns[0].lo + a.columns[1].lo * b.columns[1].lo;
  sum.hi += a.columns[0].hi * b.columns[0].hi + a.columns[1].hi * b.columns[1].hi;
}

/// sum -= a b
STEMVO_INLINE void subtract(const Block<3>& a, double b0, double b1, double b2, Column& sum) {
  sum.lo -= a[0].lo * b0 + a[1].lo * b1 + a[2].lo * b2;
  sum.hi -= a[0].hi * b0 + a[1].hi * b1 + a[2].hi * b2;
}

/// sum -= a b^T
template <std::size_t kColumns>
STEMVO_INLINE void subtract(const Block<3>& a, const Block<3>& b, Block<kColumns>& sum) {
  for (std::size_t c = 0; c < kColumns; ++c) {
    const int row = static_cast<int>(c);
    subtract(a, b[0][row], b[1][row], b[2][row], sum[c]);
  }
}

/// a b, of a symmetric b.
STEMVO_INLINE void multiply(const Block<3>& a, const Lanes4* b, Block<3>& result) {
  for (std::size_t c = 0; c < 3; ++c) {
    result[c].lo = a[0].lo * b[c][0] + a[1].lo * b[c][1] + a[2].lo * b[c][2];
    result[c].hi = a[0].hi * b[c][0] + a[1].hi * b[c][1] + a[2].hi * b[c][2];
  }
}

/// By the point in the camera, in the first three rows.
STEMVO_INLINE void by_x(const Bundle& bundle, const Reprojection& at, Jacobian& result) {
  const double bend = 2.0 * (bundle.radial[0] + 2.0 * bundle.radial[1] * at.r_sq);
  const double fx = bundle.camera.fx_px * at.inverse_z;
  const double fy = bundle.camera.fy_px * at.inverse_z;
  const double uu = at.stretch + bend * at.u * at.u;
  const double uv = bend * at.u * at.v;
  const double vv = at.stretch + bend * at.v * at.v;
  result.columns[0].lo = Lanes4{fx * uu, fx * uv, -fx * (uu * at.u + uv * at.v), 0.0};
  result.columns[1].lo = Lanes4{fy * uv, fy * vv, -fy * (uv * at.u + vv * at.v), 0.0};
}

/// By the turn and the step of the pose: x' = exp(w) x + t.
STEMVO_INLINE void by_pose(const Reprojection& at, const Jacobian& by_x, Jacobian& result) {
  const double x = at.x.data()[0];
  const double y = at.x.data()[1];
  const double z = at.x.data()[2];
  for (int k = 0; k < 2; ++k) {
    const Lanes4& by = by_x.columns[k].lo;
    result.columns[k].lo =
        Lanes4{y * by[2] - z * by[1], z * by[0] - x * by[2], x * by[1] - y * by[0], by[0]};
    result.columns[k].hi = NormalEquations::Lanes2{by[1], by[2]};
  }
}

STEMVO_INLINE void by_camera(const Bundle& bundle, const Reprojection& at, Jacobian& result) {
  const double fu = bundle.camera.fx_px * at.u;
  const double fv = bundle.camera.fy_px * at.v;
  const double r4 = at.r_sq * at.r_sq;
  result.columns[0].lo = Lanes4{1.0, 0.0, fu * at.stretch, fu * at.r_sq};
  result.columns[0].hi = NormalEquations::Lanes2{fu * r4, 0.0};
  result.columns[1].lo = Lanes4{0.0, 1.0, fv * at.stretch, fv * at.r_sq};
  result.columns[1].hi = NormalEquations::Lanes2{fv * r4, 0.0};
}

struct Rotation {
  Lanes4 rows[3];
};

STEMVO_INLINE void add_observation(const Bundle& bundle,
                                   std::size_t i,
                                   const Reprojection& at,
                                   const Rotation* rotations,
                                   NormalEquations::Point& point,
                                   NormalEquations& equations) {
  const int pose_index = bundle.observations.data()[i].pose;
  const Lanes4* rotation = rotations[pose_index].rows;
  const double* error = at.error.data();
  Jacobian in_camera;
  by_x(bundle, at, in_camera);
  Jacobian by_point;
  for (int k = 0; k < 2; ++k) {
    const Lanes4& by = in_camera.columns[k].lo;
    by_point.columns[k].lo = rotation[0] * by[0] + rotation[1] * by[1] + rotation[2] * by[2];
  }
  const Lanes4 weighted[2] = {at.weight * by_point.columns[0].lo,
                              at.weight * by_point.columns[1].lo};
  for (int c = 0; c < 3; ++c) {
    point.inverse[c] +=
        weighted[0] * by_point.columns[0].lo[c] + weighted[1] * by_point.columns[1].lo[c];
  }
  point.gradient += weighted[0] * error[0] + weighted[1] * error[1];

  const bool is_free = pose_index >= equations.num_fixed_poses;
  const int free = pose_index - equations.num_fixed_poses;
  Jacobian by_free;
  Jacobian weighted_free;
  if (is_free) {
    by_pose(at, in_camera, by_free);
    scale(by_free, at.weight, weighted_free);
    NormalEquations::Pose& pose = equations.poses.data()[free];
    equations.H_pl.data()[i] = {};
    add(weighted_free, by_point, equations.H_pl.data()[i]);
    add(weighted_free, by_free, equations.H_pp.data()[equations.index_of(free, free)]);
    add_diagonal(weighted_free, by_free, pose.diagonal);
    add(weighted_free, error[0], error[1], pose.gradient);
  }
  if (equations.has_camera) {
    Jacobian by;
    Jacobian weighted_by;
    by_camera(bundle, at, by);
    scale(by, at.weight, weighted_by);
    add(weighted_by, by_point, point.with_camera);
    add(weighted_by, by, equations.camera.with_camera);
    add_diagonal(weighted_by, by, equations.camera.diagonal);
    add(weighted_by, error[0], error[1], equations.camera.gradient);
    if (is_free) {
      add(weighted_by, by_free, equations.poses.data()[free].with_camera);
    }
  }
}

STEMVO_INLINE void invert(double damping, Lanes4* block) {
  Eigen::Matrix3d matrix;
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) {
      matrix.data()[3 * c + r] = block[c][r] * (r == c ? 1.0 + damping : 1.0);
    }
  }
  const Eigen::Matrix3d inverse = matrix.inverse();
  for (int c = 0; c < 3; ++c) {
    const double* column = inverse.data() + 3 * c;
    block[c] = Lanes4{column[0], column[1], column[2], 0.0};
  }
}

/// The point of the observations [begin, end).
STEMVO_INLINE void eliminate(const Bundle& bundle,
                             std::size_t begin,
                             std::size_t end,
                             double damping,
                             NormalEquations::Point& point,
                             NormalEquations& equations) {
  if (bundle.observations.data()[begin].point < bundle.num_fixed_points) {
    std::fill_n(point.inverse, 3, Lanes4{});  // nothing to eliminate: it does not move
  } else {
    invert(damping, point.inverse);
  }
  const Lanes4& gradient = point.gradient;
  Block<3> scaled;
  if (equations.has_camera) {
    multiply(point.with_camera, point.inverse, scaled);
    subtract(scaled, point.with_camera, equations.camera.with_camera);
    subtract(scaled, gradient[0], gradient[1], gradient[2], equations.camera.gradient);
  }
  const Bundle::Observation* observations = bundle.observations.data();
  const Block<3>* with_point = equations.H_pl.data();
  for (std::size_t i = begin; i < end; ++i) {
    const int free = observations[i].pose - equations.num_fixed_poses;
    if (free < 0) {
      continue;
    }
    NormalEquations::Pose& pose = equations.poses.data()[free];
    multiply(with_point[i], point.inverse, scaled);
    subtract(scaled, gradient[0], gradient[1], gradient[2], pose.gradient);
    if (equations.has_camera) {
      subtract(point.with_camera, scaled, pose.with_camera);
    }
    for (std::size_t j = i; j < end; ++j) {
      const int other = observations[j].pose - equations.num_fixed_poses;
      subtract(scaled, with_point[j], equations.H_pp.data()[equations.index_of(free, other)]);
    }
  }
}

STEMVO_INLINE void add_up_points(const Bundle& bundle,
                                 const std::vector<Reprojection>& at,
                                 const std::vector<Rotation>& rotations,
                                 double damping,
                                 NormalEquations& equations) {
  const Bundle::Observation* observations = bundle.observations.data();
  const std::size_t size = bundle.observations.size();
  for (std::size_t begin = 0; begin < size;) {
    const int index = observations[begin].point;
    NormalEquations::Point& point = equations.points.data()[index];
    point = {};
    std::size_t end = begin;
    for (; end < size && observations[end].point == index; ++end) {
      add_observation(bundle, end, at.data()[end], rotations.data(), point, equations);
    }
    eliminate(bundle, begin, end, damping, point, equations);
    begin = end;
  }
}

}  // namespace

Reprojection::Reprojection(const Bundle& bundle,
                           const Bundle::Observation& observation,
                           const Eigen::Matrix3d& rotation)
    : x(rotation * bundle.points[static_cast<std::size_t>(observation.point)] +
        bundle.camera_from_world[static_cast<std::size_t>(observation.pose)].translation),
      inverse_z(1.0 / x.z()),
      u(x.x() * inverse_z),
      v(x.y() * inverse_z),
      r_sq(u * u + v * v),
      stretch(1.0 + r_sq * (bundle.radial[0] + bundle.radial[1] * r_sq)),
      error(Eigen::Vector2d(bundle.camera.fx_px * u * stretch + bundle.camera.cx_px,
                            bundle.camera.fy_px * v * stretch + bundle.camera.cy_px) -
            observation.uv) {}

void NormalEquations::add_up(const Bundle& bundle,
                             const std::vector<Reprojection>& at,
                             double damping) {
  camera = {};
  std::ranges::fill(poses, Pose());
  std::ranges::fill(H_pp, Block<6>());
  std::vector<Rotation> rotations;
  for (const Rigid3& pose : bundle.camera_from_world) {
    const Eigen::Matrix3d r = pose.rotation_matrix();
    rotations.push_back(
        Rotation{{Lanes4{r(0, 0), r(0, 1), r(0, 2), 0.0}, Lanes4{r(1, 0), r(1, 1), r(1, 2), 0.0},
                  Lanes4{r(2, 0), r(2, 1), r(2, 2), 0.0}}});
  }
  run_body<add_up_points>(bundle, at, rotations, damping, *this);
}

}  // namespace stemvo
