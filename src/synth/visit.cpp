// SPDX-License-Identifier: MIT
#include "synth/visit.hpp"

#include <algorithm>
#include <cmath>

namespace stemvo::synth {
namespace {

/// Where the camera is beside its first path, by the way that is behind it: standing, it stands.
struct Detour {
  Draw draw;
  double aside_m = draw.chance(0.6) ? draw.in(-0.7, -0.3) : draw.in(0.2, 0.4);  // > 0: right
  double higher_m = draw.in(-0.06, 0.06);
  std::uint64_t key = draw.bits();
  // "Hz" are cycles a metre here.
  Sway sideways_m{key, 1, 0.08, 0.004, 0.02};
  Sway upwards_m{key, 2, 0.008, 0.03, 0.2};
  Sway yaw_rad{key, 3, radians(0.3), 0.005, 0.05};
  Sway pitch_rad{key, 4, radians(0.3), 0.012, 0.17};
  Sway roll_rad{key, 5, radians(0.3), 0.01, 0.14};

  [[nodiscard]] Rigid3 moved(const Rigid3& pose, double way_m) const {
    constexpr double kStep_m = 0.5;
    const double aside = aside_m + sideways_m.at(way_m);
    const double course_rad = (sideways_m.at(way_m + kStep_m) - sideways_m.at(way_m)) / kStep_m;
    const double up = higher_m + upwards_m.at(way_m);
    const Rigid3 first_from_again = Rigid3::from_matrix(
        rotation(course_rad + yaw_rad.at(way_m), pitch_rad.at(way_m), roll_rad.at(way_m)),
        {aside, -up, 0.0});
    return pose * first_from_again;
  }
};

}  // namespace

void drive_again(std::uint64_t seed, int visit, Drive& drive) {
  const Trajectory first = drive.world_from_camera;
  const std::vector<double> first_arcs_m = drive.arcs_m;
  Draw draw(seed, 'V', visit);
  const double speed = draw.in(0.9, 1.0);
  double at = draw.in(0.2, 0.8);  // frames of the first drive
  const Detour detour{draw};
  double way_m = 0.0;
  Vec3 before = first.front().translation;
  for (std::size_t i = 0; i < first.size(); ++i, at += speed) {
    const Rigid3 pose = pose_at(first, at);
    way_m += (pose.translation - before).norm();
    before = pose.translation;
    drive.world_from_camera[i] = detour.moved(pose, way_m);
    drive.arcs_m[i] = first_arcs_m[std::min(static_cast<std::size_t>(at), first.size() - 1)];
  }
}

Daylight daylight(std::uint64_t seed, int visit) {
  Draw draw = visit == 0 ? Draw(seed, 'L') : Draw(seed, 'L', visit);
  const double azimuth = draw.in(0.0, 2.0 * kPi);
  const double height = draw.in(0.6, 0.8);  // rad
  Daylight light{{std::cos(height) * std::sin(azimuth), -std::sin(height),
                  std::cos(height) * std::cos(azimuth)}};
  if (visit != 0) {
    light.ambient_factor = draw.in(0.8, 1.25);
    light.gain = draw.in_float(0.75, 1.25);
  }
  return light;
}

}  // namespace stemvo::synth
