// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>

#include <Eigen/Core>

#include "evaluation/trajectory.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// A coloured point of the world.
struct ColoredPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  std::array<std::uint8_t, 3> rgb{};
};

/// Colour of the camera's path in a map file.
inline constexpr std::array<std::uint8_t, 3> kMapPathColor{255, 64, 0};

/// A map as binary little-endian PLY: `vertex` (float x y z, uchar red green blue) with the points,
/// then the camera positions, and `edge` (int vertex1 vertex2) from each camera position to the
/// next. Points that are not finite are left out. Error: it cannot be written.
[[nodiscard]] Status write_map_ply(const std::filesystem::path& file,
                                   std::span<const ColoredPoint> points,
                                   std::span<const Rigid3> world_from_camera);

}  // namespace stemvo
