// SPDX-License-Identifier: MIT
#include <algorithm>
#include <numeric>

#include "synth/drive.hpp"

namespace stemvo::synth {
namespace {

/// Smallest value within `reach` knots, then the mean over the same reach: smooth and never above
/// the input, because every value in the mean already is a minimum over a window with this knot.
std::vector<double> smooth_lower_bound(const std::vector<double>& values, std::ptrdiff_t reach) {
  std::vector<double> lowest;
  std::vector<double> result;
  const auto n = std::ssize(values);
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    lowest.push_back(*std::min_element(values.begin() + std::max(i - reach, 0L),
                                       values.begin() + std::min(i + reach + 1, n)));
  }
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const auto begin = lowest.begin() + std::max(i - reach, 0L);
    const auto end = lowest.begin() + std::min(i + reach + 1, n);
    result.push_back(std::accumulate(begin, end, 0.0) / static_cast<double>(end - begin));
  }
  return result;
}

}  // namespace

RoadCurve::RoadCurve(const std::vector<Vec3>& points, const std::vector<Vec3>& ups) {
  const std::size_t last = points.size() - 1;
  knots_.resize(points.size());
  for (std::size_t i = 0; i <= last; ++i) {
    RoadFrame& frame = knots_[i];
    frame.position = points[i];
    frame.forward = (points[std::min(i + 1, last)] - points[i > 0 ? i - 1 : 0]).normalized();
    frame.right = frame.forward.cross(ups[i]).normalized();
    frame.up = frame.right.cross(frame.forward);
  }
  squeeze_in_turns();
}

/// In a bend of radius R the inner edge of the street must stay well inside R or the ribbon folds
/// over itself.
void RoadCurve::squeeze_in_turns() {
  constexpr double kShareOfRadius = 0.72;
  constexpr int kReach = 9;  // knots
  std::vector<double> left(knots_.size(), 1.0);
  std::vector<double> right(knots_.size(), 1.0);
  for (std::size_t i = 1; i + 1 < knots_.size(); ++i) {
    const Vec3 turn = knots_[i + 1].forward - knots_[i - 1].forward;
    const double curvature = turn.dot(knots_[i].right) / (2.0);  // > 0: right
    const double room = kShareOfRadius / std::max(std::abs(curvature), 1e-9);
    (curvature > 0.0 ? right : left)[i] = std::min(1.0, room / kStreetHalfWidth_m);
  }
  left = smooth_lower_bound(left, kReach);
  right = smooth_lower_bound(right, kReach);
  for (std::size_t i = 0; i < knots_.size(); ++i) {
    knots_[i].squeeze_left = left[i];
    knots_[i].squeeze_right = right[i];
  }
}

RoadFrame RoadCurve::at(double arc_m) const {
  const double x = std::clamp(arc_m, 0.0, static_cast<double>(num_knots() - 1));
  const int i = std::min(static_cast<int>(x), num_knots() - 2);
  const double t = x - i;
  const RoadFrame& a = knot(i);
  const RoadFrame& b = knot(i + 1);
  const double t2 = t * t;
  const double t3 = t2 * t;
  RoadFrame frame;
  frame.position = (2 * t3 - 3 * t2 + 1) * a.position + (3 * t2 - 2 * t3) * b.position +
                   ((t3 - 2 * t2 + t) * a.forward + (t3 - t2) * b.forward);
  frame.forward = ((1 - t) * a.forward + t * b.forward).normalized();
  frame.right = frame.forward.cross((1 - t) * a.up + t * b.up).normalized();
  frame.up = frame.right.cross(frame.forward);
  frame.squeeze_left = (1 - t) * a.squeeze_left + t * b.squeeze_left;
  frame.squeeze_right = (1 - t) * a.squeeze_right + t * b.squeeze_right;
  return frame;
}

double RoadCurve::nearest(const Vec3& point, double guess_m, double reach_m) const {
  const auto index = [&](double arc_m) {
    return std::clamp(static_cast<int>(std::lround(arc_m)), 0, num_knots() - 1);
  };
  int best = index(guess_m);
  for (int i = index(guess_m - reach_m); i <= index(guess_m + reach_m); ++i) {
    if ((knot(i).position - point).squaredNorm() < (knot(best).position - point).squaredNorm()) {
      best = i;
    }
  }
  return best;
}

}  // namespace stemvo::synth
