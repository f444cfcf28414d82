// SPDX-License-Identifier: MIT
#pragma once

#include "geometry/bundle.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

/// The lens whose frames, once `lens` is taken out of them as `view` (geometry/distortion.hpp),
/// look as the view's camera changed by `change` shows the world. Of its distortion k1 and k2 are
/// fitted; a lens without distortion becomes one with OpenCV's k1 k2. fx / fy is kept.
[[nodiscard]] Camera refined_lens(const Camera& lens,
                                  const Camera& view,
                                  const IntrinsicsDelta& change);

}  // namespace stemvo
