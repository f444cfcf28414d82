// SPDX-License-Identifier: MIT
#include "synth/house.hpp"

#include "synth/materials.hpp"

namespace stemvo::synth {
namespace {

constexpr double kFoundation_m = 1.2;  // walls go into the ground, which may slope

}  // namespace

void House::add_walls(double height_m) {
  const auto& [fl, fr, br, bl] = plan;
  const Vec3 down = -kFoundation_m * up;
  const Vec3 top = height_m * up;
  for (const auto& [left, right] : {std::pair(fl, fr), std::pair(bl, fl), std::pair(fr, br)}) {
    const double length_m = (right - left).norm();
    style.size = {static_cast<float>(length_m), static_cast<float>(height_m)};
    scene.add_face(
        {left + down, right + down, right + top, left + top},
        {Vec2(0.0, -kFoundation_m), Vec2(length_m, -kFoundation_m), Vec2(length_m, height_m)},
        style);
  }
}

void House::add_roof(double eaves_m, double rise_m, std::uint32_t seed) {
  const auto& [fl, fr, br, bl] = plan;
  const Vec3 left_ridge = 0.5 * (fl + bl) + (eaves_m + rise_m) * up;
  const Vec3 right_ridge = 0.5 * (fr + br) + (eaves_m + rise_m) * up;
  const Vec3 over_left = 0.12 * (fl - bl).normalized() - 0.1 * up;
  const Vec3 over_right = 0.12 * (fr - br).normalized() - 0.1 * up;
  const Vec3 front_left = fl + eaves_m * up + over_left;
  const Vec3 front_right = fr + eaves_m * up + over_right;
  const double length_m = (front_right - front_left).norm();
  const double slope_m = (left_ridge - front_left).norm();
  scene.add_patch(
      {front_left, front_right, right_ridge, left_ridge},
      {Vec2(0, 0), Vec2(length_m, 0), Vec2(length_m, slope_m), Vec2(0, slope_m)},
      {.material = materials::roof,
       .seed = seed,
       .albedo = (seed & 1U) != 0U ? Rgb{0.40F, 0.20F, 0.14F} : Rgb{0.24F, 0.23F, 0.23F}});
  style.material = materials::plain_wall;
  for (const auto& [front, back, ridge] :
       {std::tuple(fl, bl, left_ridge), std::tuple(fr, br, right_ridge)}) {
    const Vec3 a = front + eaves_m * up;
    const Vec3 b = back + eaves_m * up;
    const double width_m = (b - a).norm();
    scene.add_face(
        {a, b, ridge, ridge},
        {Vec2(0, eaves_m), Vec2(width_m, eaves_m), Vec2(0.5 * width_m, eaves_m + rise_m)}, style);
  }
}

}  // namespace stemvo::synth
