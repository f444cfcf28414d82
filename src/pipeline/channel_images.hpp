// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

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

struct ChannelImagesReport {
  std::size_t num_written = 0;
  std::vector<std::string> warnings;  ///< of the recording
};

/// The paper's Figure 1. For each frame: %06d_input.png, %06d_filter_%03d.png (8 bit, as the front
/// end sees it) and %06d_sheet.png with all of them.
/// Errors: those of the sequence and the model, filters outside the layer, an unreadable frame,
/// out_dir that cannot be written.
[[nodiscard]] Expected<ChannelImagesReport> write_channel_images(
    const ChannelImagesRequest& request, const RunProgress& progress = {});

}  // namespace stemvo
