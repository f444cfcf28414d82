// SPDX-License-Identifier: MIT
#include "stemvo/calibration/calibrate.hpp"

#include <algorithm>
#include <cmath>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "calibration/calibration_file.hpp"
#include "calibration/refine_camera.hpp"
#include "calibration/segment_builder.hpp"
#include "geometry/degrees.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "stemvo/odometry/odometry.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using calibration::Segment;

constexpr int kTrackWindow = 15;  ///< of KLT, px
constexpr int kNumTracks = 1000;
/// Bounds the time of the solver on long drives.
constexpr std::size_t kMaxSegments = 30;
/// Fewer do not tell how well they agree.
constexpr std::size_t kMinSegments = 3;

fs::path calibration_file(const CalibrationRequest& request) {
  return request.calibration.value_or(request.sequence_dir / "calib.txt");
}

/// Everything that can be wrong with a request before work starts.
Status check_request(const CalibrationRequest& request) {
  if (const Status status = validate(request.config); !status) {
    return status;
  }
  if (request.config.features.method != "klt") {
    return fail(
        fmt::format("features.method: expected klt, whose tracks calibration needs, "
                    "found '{}'",
                    request.config.features.method));
  }
  std::error_code code;
  if (fs::equivalent(request.out_file, calibration_file(request), code)) {
    return fail(fmt::format("{}: expected another file than the calibration to start from",
                            request.out_file.string()));
  }
  return calibration::check_can_write(request.out_file);
}

cv::Mat to_gray(const cv::Mat& frame) {
  cv::Mat gray = frame;
  if (frame.channels() == 3) {
    cv::cvtColor(frame, gray, cv::COLOR_RGB2GRAY);
  }
  return gray;
}

/// Runs the odometry over the sequence; segments without the ones too many.
std::vector<Segment> track(const KittiSequence& sequence,
                           Odometry& odometry,
                           const CalibrationProgress& progress,
                           CalibrationReport& report) {
  calibration::SegmentBuilder builder(sequence.camera(), {});
  const auto visit = [&](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& result) {
    const std::size_t number = sequence.range().begin + i;
    calibration::TrackedFrame tracked;
    if (frame) {
      if (!result.problem.empty()) {
        report.warnings.push_back(fmt::format("frame {}: {}", number, result.problem));
      }
      tracked = {to_gray(*frame), result.world_from_camera,
                 is_measured(result.state) && result.state != FrameState::kFirst,
                 odometry.matches(), odometry.inlier_mask()};
    } else {
      report.warnings.push_back(frame.error().message);
      tracked.world_from_camera = result.world_from_camera;
    }
    builder.add(tracked);
    report.interrupted = progress && !progress(CalibrationStage::kTracking, i + 1, sequence.size());
    return !report.interrupted;
  };
  pipeline::run_frames(sequence, odometry, visit);
  std::vector<Segment> segments = builder.finish();
  calibration::keep_turns(segments, kMaxSegments);
  return segments;
}

void describe(const std::vector<Segment>& segments, CalibrationReport& report) {
  report.num_segments = segments.size();
  for (const Segment& segment : segments) {
    report.turned_deg += kDegPerRad * calibration::turned_rad(segment);
    report.num_landmarks += segment.landmarks.size();
    for (const calibration::Landmark& landmark : segment.landmarks) {
      report.num_observations += landmark.observations.size();
    }
  }
}

void describe(const calibration::RefinedCamera& refined,
              const calibration::RefinementOptions& options,
              CalibrationReport& report) {
  const calibration::SharedVector given = calibration::shared_of(report.given);
  const std::array<const char*, 3> names = {"focal length", "principal point x",
                                            "principal point y"};
  for (int i = 0; i < calibration::kNumIntrinsics; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double unit = i == 0 ? report.given.mean_focal_px() : 1.0;
    report.parameters[at] = {names[at],
                             given[i],
                             refined.shared[i],
                             refined.deviation[i],
                             unit * options.max_deviation[at],
                             refined.is_determined[at]};
  }
  report.distortion = {refined.shared[3], refined.shared[4]};
  report.distortion_deviation = {refined.deviation[3], refined.deviation[4]};
  report.refined = calibration::with_shared(report.given, refined.shared);
  report.given_error_px = refined.given_error_px;
  report.refined_error_px = refined.refined_error_px;
}

bool any_determined(const CalibrationReport& report) {
  return std::any_of(report.parameters.begin(), report.parameters.end(),
                     [](const CalibratedParameter& parameter) { return parameter.is_determined; });
}

Expected<Odometry> create_odometry(const CalibrationRequest& request, const Camera& camera) {
  Config config = request.config;
  config.odometry.mode = "map";
  config.scale.source = "constant";
  // Long tracks count here, and their bias does not: every observation is aligned anew.
  config.features.klt_window = std::max(config.features.klt_window, kTrackWindow);
  config.features.max_features = std::max(config.features.max_features, kNumTracks);
  config.stem.upsample = "bicubic";
  return Odometry::create(config, camera, request.models_dir);
}

}  // namespace

Expected<CalibrationReport> calibrate_sequence(const CalibrationRequest& request,
                                               const CalibrationProgress& progress) {
  const Expected<KittiSequence> sequence = KittiSequence::open(
      request.sequence_dir,
      {request.config.input.camera, request.frames, std::nullopt, calibration_file(request)});
  if (!sequence) {
    return sequence.error();
  }
  if (const Status status = check_request(request); !status) {
    return status.error();
  }
  Expected<Odometry> odometry = create_odometry(request, sequence->camera());
  if (!odometry) {
    return odometry.error();
  }
  CalibrationReport report;
  report.given = report.refined = sequence->camera();
  std::vector<Segment> segments = track(*sequence, *odometry, progress, report);
  if (report.interrupted) {
    return report;
  }
  if (segments.size() < kMinSegments) {
    return fail(fmt::format(
        "{}: expected frames for at least {} stretches of 5 keyframes or more that move and share "
        "tracks, found {} in {} frames",
        request.sequence_dir.string(), kMinSegments, segments.size(), sequence->size()));
  }
  const calibration::RefinementOptions options;
  const calibration::RefinedCamera refined = calibration::refine_camera(
      segments, sequence->camera(), options, [&progress](std::size_t done, std::size_t total) {
        return !progress || progress(CalibrationStage::kSolving, done, total);
      });
  report.interrupted = refined.stopped;
  describe(segments, report);
  describe(refined, options, report);
  if (report.interrupted || !any_determined(report)) {
    return report;
  }
  const Expected<std::string> text =
      calibration::rewrite_calibration(calibration_file(request), report.given, report.refined);
  if (!text) {
    return text.error();
  }
  if (const Status status = calibration::replace_file(request.out_file, *text); !status) {
    return status.error();
  }
  report.written = true;
  return report;
}

}  // namespace stemvo
