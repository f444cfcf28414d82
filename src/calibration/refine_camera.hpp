// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "calibration/calibrate.hpp"
#include "calibration/segments.hpp"
#include "stemvo/camera.hpp"

namespace stemvo::calibration {

/// The camera under which the segments fit together best. Numbers that the segments do not
/// determine go back to what was given, the worst first, and the rest is solved again. `on_step`:
/// steps done, in all (an upper bound); false stops. The caller says warnings and what was written.
[[nodiscard]] CalibrationReport refine_camera(
    const std::vector<Segment>& segments,
    const Camera& given,
    const std::function<bool(std::size_t, std::size_t)>& on_step);

}  // namespace stemvo::calibration
