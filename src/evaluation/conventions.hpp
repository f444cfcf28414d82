// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <span>
#include <string>

#include "stemvo/rigid3.hpp"

namespace stemvo {

/// What the poses seem to be where they are not the camera's in the world, as world_from_camera,
/// with x right, y down, z forward: camera_from_world, quaternions with w first, a robot's axes or
/// OpenGL's. Nullopt: they fit the ground truth as they are, or nothing explains why they do not.
/// Both have the same length (checked). Lengths may have any unit.
[[nodiscard]] std::optional<std::string> other_convention(std::span<const Rigid3> estimate,
                                                          std::span<const Rigid3> ground_truth);

}  // namespace stemvo
