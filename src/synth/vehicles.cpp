// SPDX-License-Identifier: MIT
#include "synth/vehicles.hpp"

#include <algorithm>

namespace stemvo::synth {

void add_parked_car(const RoadFrame& place, Draw draw, Scene& scene) {
  constexpr double kLateral_m = 3.35;
  const float gray = draw.in_float(0.05, 0.75);
  const float tint = draw.in_float(-0.12, 0.12);
  const Rgb paint = {gray + std::max(tint, 0.0F), gray, gray + std::max(-tint, 0.0F)};
  const std::uint32_t seed = draw.bits();
  const double width = draw.in(1.65, 1.8);
  const double length = draw.in(3.9, 4.7);
  struct Part {
    Rgb albedo;
    Vec3 corner;  ///< along, to the right, up from the car's corner; metres
    Vec3 size;
  };
  constexpr Rgb kTyre = {0.03F, 0.03F, 0.03F};
  constexpr Rgb kLamp = {0.6F, 0.12F, 0.1F};
  const std::array<Part, 9> parts = {{
      {paint, {0.0, 0.0, 0.3}, {length, width, 0.52}},
      {{0.07F, 0.08F, 0.09F}, {0.12 * length, 0.09, 0.82}, {0.55 * length, width - 0.18, 0.5}},
      {paint, {0.2 * length, 0.12, 1.32}, {0.38 * length, width - 0.24, 0.1}},
      {kTyre, {0.12 * length, -0.02, 0.0}, {0.6, width + 0.04, 0.58}},
      {kTyre, {0.72 * length, -0.02, 0.0}, {0.6, width + 0.04, 0.58}},
      {kLamp, {-0.02, 0.05, 0.62}, {0.02, 0.3, 0.14}},
      {kLamp, {-0.02, width - 0.35, 0.62}, {0.02, 0.3, 0.14}},
      {{0.85F, 0.85F, 0.82F}, {-0.02, 0.5 * width - 0.26, 0.5}, {0.02, 0.52, 0.11}},
      // A thin dark mat below the car: what the sky cannot reach.
      {{0.07F, 0.07F, 0.075F}, {-0.1, -0.1, 0.0}, {length + 0.2, width + 0.2, 0.015}},
  }};
  for (const auto& [albedo, corner, size] : parts) {
    const Vec3 at = place.point(kLateral_m, 0.0) + corner.x() * place.forward +
                    (corner.y() - 0.5 * width) * place.right + corner.z() * place.up;
    scene.add_box(at, {size.x() * place.forward, size.y() * place.right, size.z() * place.up},
                  {.seed = seed, .albedo = albedo});
  }
}

}  // namespace stemvo::synth
