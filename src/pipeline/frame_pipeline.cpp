// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <utility>

#include "odometry/odometry_loops.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {

void run_frames(const FrameSource& sequence, PhasedOdometry& odometry, const FrameVisitor& visit) {
  std::size_t num_visited = 0;
  OdometryLoops loops(odometry, [&](const GivenFrame& given, const FrameResult& result) {
    return visit(num_visited++, given.image, result);
  });
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    Expected<cv::Mat> image = timed(Stage::kRead, [&] { return sequence.read(i); });
    const bool has_ended = sequence.stream() && image && image->empty();
    if (has_ended || !loops.push({std::move(image), sequence.time_s(i), {}})) {
      break;
    }
  }
  loops.finish();
}

}  // namespace stemvo::pipeline
