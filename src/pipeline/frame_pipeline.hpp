// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>

#include <opencv2/core.hpp>

#include "stemvo/dataset/frame_source.hpp"
#include "stemvo/error.hpp"
#include "stemvo/odometry/odometry.hpp"

namespace stemvo::pipeline {

/// Called for each frame, in order, one call at a time, not always from the same thread, while
/// the odometry holds what it knows of this frame. `index` counts from 0; `frame` is the picture or
/// the Error that names its file. False ends the run: frames already read ahead are dropped.
using FrameVisitor =
    std::function<bool(std::size_t index, const Expected<cv::Mat>& frame, const FrameResult& pose)>;

/// Takes the frames of a sequence through an odometry. Reading, the stem and the rest work on
/// different frames at the same time, on as many threads as ThreadScope allows (without one: a
/// thread per core), OpenCV's loops included, a few frames ahead at most; the poses do not depend
/// on it. What a stage or the visitor throws leaves this function; frames behind the last one
/// visited are dropped then.
void run_frames(const FrameSource& sequence, Odometry& odometry, const FrameVisitor& visit);

}  // namespace stemvo::pipeline
