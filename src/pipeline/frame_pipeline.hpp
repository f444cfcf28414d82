// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/core/utility.hpp>
#include <tbb/global_control.h>

#include "dataset/frame_source.hpp"
#include "dataset/motion_file.hpp"
#include "odometry/phased_odometry.hpp"
#include "odometry/way.hpp"
#include "pipeline/run.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"

namespace stemvo::pipeline {

struct BesideFrames {
  std::vector<Way> ways;                ///< by speeds
  std::vector<dataset::GyroRow> gyro;   ///< in the camera's axes
  std::string note;                     ///< what there is, for the line of the input; may be empty
  std::vector<std::string> unit_notes;  ///< how times were read, a line each; may be empty
  struct Span {
    std::string option;
    double first_s;
    double last_s;
  };
  std::vector<Span> spans;  ///< of the files read

  /// A line for each file whose times are all before or all behind those of the frames.
  [[nodiscard]] std::vector<std::string> warnings(double first_s, double last_s) const;
};

/// Reads the files that were asked for. Errors: theirs; speeds beside a scale.source that leaves no
/// room for them.
[[nodiscard]] Expected<BesideFrames> read_beside_frames(const RunRequest& request,
                                                        const FrameSource& sequence);

/// Called for each frame, in order, one call at a time, maybe from another thread, while the
/// odometry holds what it knows of this frame. `index` counts from 0; `frame` is the image or
/// the Error that names its file. False ends the run: frames already read ahead are dropped.
using FrameVisitor =
    std::function<bool(std::size_t index, const Expected<cv::Mat>& frame, const FrameResult& pose)>;

/// Takes the frames of a sequence through an odometry. What a stage or the visitor throws leaves
/// this function; frames behind the last one visited are dropped then.
void run_frames(const FrameSource& sequence,
                PhasedOdometry& odometry,
                const FrameVisitor& visit,
                const BesideFrames& beside = {});

/// OpenCV works on `num_threads` threads (0: one per core) in the whole process from here on. TBB,
/// where OpenCV is built with it, holds to them while the result lives.
[[nodiscard]] inline tbb::global_control limit_threads(int num_threads) {
  const int limit = num_threads > 0 ? num_threads : cv::getNumberOfCPUs();
  cv::setNumThreads(limit);
  return {tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(limit)};
}

}  // namespace stemvo::pipeline
