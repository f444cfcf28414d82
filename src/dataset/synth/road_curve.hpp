// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <Eigen/Core>

namespace stemvo::synth {

/// Spacing of the knots along a road: the arc length of knot i is i * 1 m.
inline constexpr double kKnotSpacing_m = 1.0;
/// Road beyond the first and the last camera, so that the view never ends in nothing.
inline constexpr double kRoadBehind_m = 80.0;
inline constexpr double kRoadAhead_m = 190.0;
inline constexpr double kCameraHeight_m = 1.65;
/// Half width of a street between the hedges, where it is not squeezed by a tight turn.
inline constexpr double kStreetHalfWidth_m = 13.0;

/// The road's own axes at one place, in the world (metres). right x (-up) = forward.
struct RoadFrame {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d forward = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d right = Eigen::Vector3d::UnitX();
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
  double squeeze_left = 1.0;  ///< factor on lateral distances where a tight turn leaves less room
  double squeeze_right = 1.0;

  [[nodiscard]] double squeeze(double lateral_m) const {
    return lateral_m < 0.0 ? squeeze_left : squeeze_right;
  }
  /// `lateral_m` to the right as planned (before squeezing), `height_m` above the road.
  [[nodiscard]] Eigen::Vector3d point(double lateral_m, double height_m) const {
    return position + squeeze(lateral_m) * lateral_m * right + height_m * up;
  }
};

/// A road as equally spaced frames.
class RoadCurve {
 public:
  RoadCurve() = default;
  /// Points 1 m apart on the road's surface under the camera's path, and an up direction for each;
  /// at least 3.
  RoadCurve(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& ups);

  [[nodiscard]] int num_knots() const { return static_cast<int>(knots_.size()); }
  [[nodiscard]] const RoadFrame& knot(int index) const {
    return knots_[static_cast<std::size_t>(index)];
  }
  [[nodiscard]] double length_m() const { return kKnotSpacing_m * (num_knots() - 1); }
  /// Between the knots: position by cubic Hermite, so that a camera on it moves smoothly.
  [[nodiscard]] RoadFrame at(double arc_m) const;
  /// Arc length of the knot nearest to `point` among those within `reach_m` of `guess_m`.
  [[nodiscard]] double nearest(const Eigen::Vector3d& point, double guess_m, double reach_m) const;

 private:
  void squeeze_in_turns();

  std::vector<RoadFrame> knots_;
};

}  // namespace stemvo::synth
