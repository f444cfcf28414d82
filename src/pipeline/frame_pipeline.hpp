// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>

#include <opencv2/core.hpp>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "odometry/phased_odometry.hpp"
#include "pipeline/beside_frames.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// Called for each frame, in order, one call at a time, maybe from another thread, while the
/// odometry holds what it knows of this frame. `index` counts from 0; `frame` is the image or
/// the Error that names its file. False ends the run: frames already read ahead are dropped.
using FrameVisitor =
    std::function<bool(std::size_t index, const Expected<cv::Mat>& frame, const FrameResult& pose)>;

/// Takes the frames of a sequence through an odometry, read here and worked on in
/// OdometryLoops. What a stage or the visitor throws leaves this function; frames behind the last
/// one visited are dropped then.
void run_frames(const FrameSource& sequence,
                PhasedOdometry& odometry,
                const FrameVisitor& visit,
                const BesideFrames& beside = {});

}  // namespace stemvo::pipeline
