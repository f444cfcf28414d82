// SPDX-License-Identifier: MIT
#pragma once

#include "arrays.hpp"
#include "dataset/frame_source.hpp"
#include "odometry/frame_view.hpp"

namespace stemvo::python {

/// View of a camera file for frames that come from elsewhere.
struct CameraView {
  FrameSource frames;  ///< none of its own
  FrameView view;
};

/// Frames of a Recording or a FrameView; nullptr: of neither.
[[nodiscard]] const FrameSource* frames_of(nb::handle object);

}  // namespace stemvo::python
