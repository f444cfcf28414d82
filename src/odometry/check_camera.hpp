// SPDX-License-Identifier: MIT
#pragma once

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Error: a size of no pixels or too many, a focal length not above 0, a number that is not finite.
[[nodiscard]] Status check_camera(const Camera& camera);

}  // namespace stemvo
