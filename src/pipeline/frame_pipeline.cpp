// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <utility>

#include "odometry/odometry_loops.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {

void run_frames(const FrameSource& sequence,
                PhasedOdometry& odometry,
                const FrameVisitor& visit,
                const BesideFrames& beside) {
  std::size_t num_visited = 0;
  OdometryLoops loops(
      odometry,
      [&](const GivenFrame& given, const FrameResult& result) {
        return visit(num_visited++, given.image, result);
      },
      odometry.num_threads());
  double last_s = 0.0;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    Expected<cv::Mat> image = timed(Stage::kRead, [&] { return sequence.read(i); });
    const bool has_ended = sequence.stream && image && image->empty();
    if (has_ended) {
      break;
    }
    const double time_s = sequence.time_s(i);
    GivenFrame given{std::move(image), time_s, {}, {}};
    if (i == 0) {
      given.ways = beside.ways;
    } else {
      given.hints = beside.hints(last_s, time_s);
    }
    last_s = time_s;
    if (!loops.push(std::move(given))) {
      break;
    }
  }
  loops.finish();
}

}  // namespace stemvo::pipeline
