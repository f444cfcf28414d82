// SPDX-License-Identifier: MIT
#include "pipeline/frame_pipeline.hpp"

#include <limits>
#include <utility>

#include <fmt/format.h>

#include "odometry/odometry_loops.hpp"
#include "timing/stage_timer.hpp"
#include "try.hpp"

namespace stemvo::pipeline {
namespace {

std::optional<std::pair<double, double>> span_of(const FrameSource& sequence) {
  const auto& times_s = sequence.timestamps_s;
  return sequence.stream || times_s.empty()
             ? std::nullopt
             : std::optional(std::pair(times_s.front(), times_s.back()));
}

Status add_speeds(const RunRequest& request, const FrameSource& sequence, BesideFrames& beside) {
  if (request.config.scale_choice == ScaleChoice::kGroundTruth) {
    return fail("--speed: expected scale.source none or camera_height, found ground_truth");
  }
  STEMVO_TRY_GET(const auto found, dataset::read_speeds(*request.speeds, span_of(sequence)));
  const auto& rows = found.rows;
  WayInput input(request.config.scale.source);
  for (const dataset::SpeedRow& row : rows) {
    STEMVO_TRY(named("--speed", input.add_speed(row.time_s, row.metres_per_s, row.sigma)));
  }
  beside.ways = input.take(std::numeric_limits<double>::infinity());
  if (beside.ways.empty()) {
    return fail("--speed: expected speeds at most 1.5 s from the next, found none");
  }
  beside.note += fmt::format(", {} speeds", rows.size());
  add_line(beside.unit_notes, found.note);
  beside.spans.push_back({"--speed", rows.front().time_s, rows.back().time_s});
  return {};
}

Status add_gyro(const RunRequest& request, const FrameSource& sequence, BesideFrames& beside) {
  STEMVO_TRY_GET(auto found, dataset::read_gyro(*request.gyro, span_of(sequence)));
  auto& rows = found.rows;
  const auto& camera_from_imu = sequence.camera_from_imu;
  for (dataset::GyroRow& row : rows) {
    row.time_s -= sequence.imu_from_camera_s;
    row.rad_per_s = camera_from_imu.value_or(Eigen::Quaterniond::Identity()) * row.rad_per_s;
  }
  beside.note += fmt::format(", {} turn rates{}", rows.size(),
                             camera_from_imu ? "" : " (taken for about the camera's own axes)");
  add_line(beside.unit_notes, found.note);
  beside.spans.push_back({"--gyro", rows.front().time_s, rows.back().time_s});
  beside.gyro = std::move(rows);
  return {};
}

}  // namespace

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
      given.hints.prev_from_cur = dataset::integrate_gyro(beside.gyro, last_s, time_s);
    }
    last_s = time_s;
    if (!loops.push(std::move(given))) {
      break;
    }
  }
  loops.finish();
}

std::vector<std::string> BesideFrames::warnings(double first_s, double last_s) const {
  std::vector<std::string> warnings;
  for (const Span& span : spans) {
    if (span.last_s < first_s || span.first_s > last_s) {
      warnings.push_back(fmt::format(
          "{}: expected times among those of the frames, {} to {} s, found {} to {} s: it says "
          "nothing of them",
          span.option, first_s, last_s, span.first_s, span.last_s));
    }
  }
  return warnings;
}

Expected<BesideFrames> read_beside_frames(const RunRequest& request, const FrameSource& sequence) {
  BesideFrames beside;
  if (request.speeds) {
    STEMVO_TRY(add_speeds(request, sequence, beside));
  }
  if (request.gyro) {
    STEMVO_TRY(add_gyro(request, sequence, beside));
  }
  return beside;
}

}  // namespace stemvo::pipeline
