// SPDX-License-Identifier: MIT
#include "calibration/calibrate.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "calibration/refine_camera.hpp"
#include "calibration/segments.hpp"
#include "dataset/kitti_text.hpp"
#include "odometry/phased_odometry.hpp"
#include "options/option_fields.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using calibration::Segment;

constexpr int kTrackWindow = 15;  ///< of KLT, px
constexpr int kNumTracks = 1000;
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
  const FeatureMethod method = request.config.features.method;
  if (method != FeatureMethod::kPatch && method != FeatureMethod::kKlt) {
    return fail(
        fmt::format("features.method: expected patch or klt, whose tracks calibration needs, "
                    "found '{}'",
                    options::to_string(method)));
  }
  std::error_code code;
  if (fs::equivalent(request.out_file, calibration_file(request), code)) {
    return fail(fmt::format("{}: expected another file than the calibration to start from",
                            request.out_file.string()));
  }
  return check_can_replace(request.out_file);
}

cv::Mat to_gray(const cv::Mat& frame) {
  cv::Mat gray = frame;
  if (frame.channels() == 3) {
    cv::cvtColor(frame, gray, cv::COLOR_RGB2GRAY);
  }
  return gray;
}

/// Runs the odometry over the sequence.
std::vector<Segment> track(const KittiSequence& sequence,
                           PhasedOdometry& odometry,
                           const CalibrationProgress& progress,
                           CalibrationReport& report) {
  calibration::SegmentBuilder builder(sequence.camera());
  const auto visit = [&](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& result) {
    const std::size_t number = sequence.range().begin + i;
    calibration::TrackedFrame tracked;
    if (frame) {
      if (!result.problem.empty()) {
        report.warnings.push_back(fmt::format("frame {}: {}", number, result.problem));
      }
      tracked = {to_gray(*frame), result.world_from_camera,
                 is_measured(result.state) && result.state != FrameState::kFirst,
                 odometry.frames().matches(), odometry.frames().inlier_mask()};
    } else {
      report.warnings.push_back(frame.error().message);
      tracked.world_from_camera = result.world_from_camera;
    }
    builder.add(tracked);
    report.interrupted = progress && !progress(CalibrationStage::kTracking, i + 1, sequence.size());
    return !report.interrupted;
  };
  pipeline::run_frames(sequence, odometry, visit);
  return builder.complete();
}

Expected<PhasedOdometry> create_odometry(const CalibrationRequest& request, const Camera& camera) {
  Config config = request.config;
  config.odometry.mode = OdometryMode::kMap;
  config.scale.source = ScaleSource::kConstant;
  config.camera.refine = CameraRefinement::kOff;
  // Long tracks count here, and their bias does not: every observation is aligned anew.
  config.features.method = FeatureMethod::kKlt;
  config.features.klt_window = std::max(config.features.klt_window, kTrackWindow);
  config.features.max_features = std::max(config.features.max_features, kNumTracks);
  config.stem.upsample = Upsample::kBicubic;
  return pipeline::create_odometry(config, camera, request.models_dir);
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
  Expected<PhasedOdometry> odometry = create_odometry(request, sequence->camera());
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
  std::vector<std::string> warnings = std::move(report.warnings);
  report = calibration::refine_camera(
      segments, sequence->camera(), [&progress](std::size_t done, std::size_t total) {
        return !progress || progress(CalibrationStage::kSolving, done, total);
      });
  report.warnings = std::move(warnings);
  report.num_segments = segments.size();
  const bool is_any_determined = std::any_of(report.parameters.begin(), report.parameters.end(),
                                             std::mem_fn(&CalibratedParameter::is_determined));
  if (report.interrupted || !is_any_determined) {
    return report;
  }
  const Expected<std::string> text =
      dataset::replace_kitti_camera(calibration_file(request), report.given, report.refined);
  if (!text) {
    return text.error();
  }
  if (const Status status = replace_text_file(request.out_file, *text); !status) {
    return status.error();
  }
  report.written = true;
  return report;
}

std::string format_calibration_table(const CalibrationReport& report) {
  const auto& [f, cx, cy, k1, k2] = report.parameters;
  TextTable table("lrrrl");
  table.add({"px", "given", "refined", "deviation", "change"});
  table.rule();
  for (const CalibratedParameter* number : {&f, &cx, &cy}) {
    table.add(
        {number->name, fmt::format("{:.2f}", number->given), fmt::format("{:.2f}", number->refined),
         std::isfinite(number->deviation) ? fmt::format("{:.2f}", number->deviation) : "unknown",
         number->is_determined ? fmt::format("{:+.2f} ({:+.2f} %)", number->refined - number->given,
                                             100.0 * (number->refined / number->given - 1.0))
                               : fmt::format("undetermined (deviation above {:.2f}): as given",
                                             number->max_deviation)});
  }
  table.rule();
  table.add({"reprojection error", fmt::format("{:.4f}", report.given_error_px),
             fmt::format("{:.4f}", report.refined_error_px)});
  return table.str() +
         fmt::format(
             "from {} observations of {} landmarks in {} stretches that turn {:.0f} degrees in "
             "all\nradial distortion left in the frames, which calib.txt cannot hold: k1 {:+.4f} "
             "+- {:.4f}, k2 {:+.4f} +- {:.4f}\n",
             report.num_observations, report.num_landmarks, report.num_segments, report.turned_deg,
             k1.refined, k1.deviation, k2.refined, k2.deviation);
}

}  // namespace stemvo
