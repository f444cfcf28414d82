// SPDX-License-Identifier: MIT
#pragma once

#include "arrays.hpp"
#include "dataset/frame_source.hpp"
#include "dataset/frame_view.hpp"

namespace stemvo::python {

/// What a camera file makes of frames that come from elsewhere.
struct CameraView {
  FrameList frames;  ///< none of its own
  dataset::FrameView view;
};

/// Of a Recording or a FrameView; nullptr: of neither.
[[nodiscard]] const FrameList* frames_of(nb::handle object);

}  // namespace stemvo::python
