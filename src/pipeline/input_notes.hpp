// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>

#include "dataset/frame_source.hpp"
#include "pipeline/result_files.hpp"
#include "pipeline/run.hpp"

namespace stemvo::pipeline {

/// Tells request.note what the input was taken for.
void note_input(const RunRequest& request, const FrameSource& sequence);

/// " for 11 of 12 frames", and why not for the others.
[[nodiscard]] std::string count_matched(const RunRequest& request,
                                        std::size_t num_matched,
                                        std::size_t num_frames);

/// Frames in all, of a stream as its container says; 0: not known, or said wrongly.
[[nodiscard]] std::size_t expected_frames(const FrameSource& sequence, std::size_t num_done);

/// Frames in all are known now. An interrupt is the usual end of a live camera; a video that ends
/// long before its container says is a warning.
void end_stream(const FrameSource& sequence, const RunProgress& progress, Drive& drive);

}  // namespace stemvo::pipeline
