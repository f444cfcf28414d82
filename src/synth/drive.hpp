// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <opencv2/core/types.hpp>

#include "evaluation/trajectory.hpp"
#include "synth/scene.hpp"
#include "synth/synth.hpp"

namespace stemvo::synth {

/// Road beyond the first and the last camera, so that the view never ends in nothing.
inline constexpr double kRoadBehind_m = 80.0;
inline constexpr double kRoadAhead_m = 190.0;
inline constexpr double kCameraHeight_m = 1.65;
/// Half width of a street between the hedges, where it is not squeezed by a tight turn.
inline constexpr double kStreetHalfWidth_m = 13.0;

/// The road's own axes at one position, in the world (metres). right x (-up) = forward.
struct RoadFrame {
  Vec3 position = Vec3::Zero();
  Vec3 forward = Vec3::UnitZ();
  Vec3 right = Vec3::UnitX();
  Vec3 up = -Vec3::UnitY();
  double squeeze_left = 1.0;  ///< factor on lateral distances where a tight turn leaves less room
  double squeeze_right = 1.0;

  [[nodiscard]] double squeeze(double lateral_m) const {
    return lateral_m < 0.0 ? squeeze_left : squeeze_right;
  }
  /// `lateral_m` to the right as planned (before squeezing), `height_m` above the road.
  [[nodiscard]] Vec3 point(double lateral_m, double height_m) const {
    return position + squeeze(lateral_m) * lateral_m * right + height_m * up;
  }
};

/// Knots [begin, end) of a road. Knot i is the same place as knot i - shift; 0: seen first here.
struct RoadPart {
  int begin;
  int end;
  int shift;
};

/// A polyline with an up direction at each point.
struct Path {
  std::vector<Vec3> points;
  std::vector<Vec3> ups;

  void add(const Vec3& point, const Vec3& up) {
    points.push_back(point);
    ups.push_back(up);
  }
};

/// A road as frames 1 m apart: the arc length of knot i is i.
class RoadCurve {
 public:
  /// `path`: points 1 m apart on the road's surface under the camera's, at least 3. `parts` cover
  /// all knots in order; none: all of it is new.
  explicit RoadCurve(const Path& path, std::vector<RoadPart> parts = {});

  [[nodiscard]] int num_knots() const { return static_cast<int>(knots_.size()); }
  [[nodiscard]] const RoadFrame& knot(int index) const {
    return knots_[static_cast<std::size_t>(index)];
  }
  [[nodiscard]] const std::vector<RoadPart>& parts() const { return parts_; }
  [[nodiscard]] const RoadPart& part_of(int knot) const {
    return *std::ranges::upper_bound(parts_, knot, {}, &RoadPart::end);
  }
  [[nodiscard]] int home(int knot) const { return knot - part_of(knot).shift; }
  /// Whether a thing of the street at `knot`, so far from its middle, would stand on the road (from
  /// beyond the sidewalk: on it, too) that goes another way at a fork.
  [[nodiscard]] bool is_in_the_way(int knot, double lateral_m, const Vec3& point) const;
  /// Between the knots: position by cubic Hermite, so that a camera on it moves smoothly.
  [[nodiscard]] RoadFrame at(double arc_m) const;

 private:
  std::vector<RoadFrame> knots_;
  std::vector<RoadPart> parts_;
};

/// The mean around each value, weighted by how far the others are from it. At the ends the window
/// shrinks evenly, so that a straight line stays where it is.
template <typename T, typename Weight>
std::vector<T> weighted_means(const std::vector<T>& values, int reach, const Weight& weight_of) {
  const int n = static_cast<int>(values.size());
  std::vector<T> means;
  for (int i = 0; i < n; ++i) {
    const int span = std::min({reach, i, n - 1 - i});
    T sum = 0.0 * values.front();
    double total = 0.0;
    for (int k = -span; k <= span; ++k) {
      const double weight = weight_of(k);
      sum += weight * values[static_cast<std::size_t>(i + k)];
      total += weight;
    }
    means.emplace_back(sum / total);
  }
  return means;
}

/// Camera poses and the road under them. The world is any frame in which -y is roughly up.
struct Drive {
  RoadCurve road;
  Trajectory world_from_camera;
  std::vector<double> arcs_m;  ///< per pose, along the road
};

/// Between frames the camera moves and turns evenly; before the first and after the last it stands.
[[nodiscard]] Rigid3 pose_at(const Trajectory& poses, double frame);

inline constexpr double kDriveRate_hz = 10.0;

/// A street with turns to both sides, gentle hills and banks, driven at 8-12 m/s (slower in turns);
/// the camera pitches and rolls against the road by about 0.4 deg (standard deviation) and bounces
/// by 1-2 cm. `stops`: it stands for 4 to 7 s every 60 to 150 m, on a straight stretch.
[[nodiscard]] Drive make_own_drive(int num_frames, std::uint64_t seed, bool stops = false);

/// The road that fits given camera poses: 1.65 m below the smoothed path, with its elevation and
/// bank. What the smoothing takes away is how the camera moves against the road. The car may stand,
/// turn on the spot and reverse. A drive that comes back to a street in the same direction is on
/// the same street; its poses are lifted there to the street's height, and are kept exactly
/// elsewhere.
[[nodiscard]] Drive make_drive_along(const Trajectory& world_from_camera);

/// Length of the piece of ground that a house and its garden take.
inline constexpr double kLot_m = 16.0;

/// Knots that are seen from `arc_m`: the road itself, then, where it forks, the other ways.
[[nodiscard]] std::vector<cv::Range> ways_in_view(const RoadCurve& road, double arc_m);

/// The street near `arc_m`: from 60 m behind to 170 m ahead. `crossings`: knots, where it was seen
/// first, in the middle of roads that cross.
void add_street(const RoadCurve& road,
                double arc_m,
                std::uint64_t seed,
                Scene& scene,
                const std::vector<int>& crossings = {});

/// A courtyard of some 8 m x 8 m: three walkways each way with a thing between every four of them,
/// walls all round. x right, z forward, floor at y = 0, -y up; metres.
struct Courtyard {
  std::uint64_t seed = 0;
  std::array<double, 3> x_m{};     ///< walkways along z
  std::array<double, 3> z_m{};     ///< walkways along x
  std::array<double, 4> wall_m{};  ///< from the outer walkways: left, right, near, far
  bool has_blank_walls = false;    ///< of one colour each, with nothing before two of them
};

[[nodiscard]] Courtyard lay_courtyard(std::uint64_t seed);
void add_courtyard(const Courtyard& courtyard, Scene& scene);

/// Poses of a hand-held camera, and the courtyard around them.
struct Walk {
  Trajectory world_from_camera;
  Courtyard courtyard;
};

/// A walk with a camera in the hand, some 1.5 m above the floor, at 0.5 m/s in the mean: the sway
/// of steps, slow wander of the view, turns, glances aside and pauses. Each visit takes another way
/// through the courtyard of `seed`.
[[nodiscard]] Walk make_walk(int num_frames, std::uint64_t seed, const RenderOptions& options = {});

/// The same street driven again: up to 0.9 m further left or 0.6 m further right, with other sway,
/// at 0.9 to 1 times the speed, from between the first two frames on.
void drive_again(std::uint64_t seed, int visit, Drive& drive);

}  // namespace stemvo::synth
