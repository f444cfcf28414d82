// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "pipeline/run.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Everything `stemvo channel` was asked for.
struct ChannelImagesRequest : FrameSourceRequest {
  std::filesystem::path out_dir;
  Config config;                             ///< `input` and `stem` are used
  std::optional<FrameRangeRequest> filters;  ///< half open, as frames; else all of the layer
};

/// The paper's Figure 1. For each frame: %06d_input.png, %06d_filter_%03d.png (8 bit, as the front
/// end sees it) and %06d_sheet.png with all of them. Returns the number of images written.
/// Errors: those of the sequence and the model, filters outside the layer, an unreadable frame,
/// out_dir that cannot be written.
[[nodiscard]] Expected<std::size_t> write_channel_images(const ChannelImagesRequest& request,
                                                         const RunProgress& progress = {});

}  // namespace stemvo
