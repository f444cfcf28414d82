// SPDX-License-Identifier: MIT
#include "calibration/calibrate.hpp"

#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "dataset/kitti_text.hpp"
#include "odometry/phased_odometry.hpp"
#include "odometry/self_calibration.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/out_folder.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

/// A number less certain than this is not determined: px, and a share of the focal length.
constexpr double kMaxSigma_px = 2.0;
constexpr double kMaxSigmaOfFocal = 0.01;

fs::path calibration_file(const CalibrationRequest& request) {
  return request.calibration.value_or(request.sequence_dir / "calib.txt");
}

/// Everything that can be wrong with a request before work starts.
Status check_request(const CalibrationRequest& request, const FrameSource& sequence) {
  if (const Status status = validate(request.config); !status) {
    return status;
  }
  std::vector<fs::path> inputs = pipeline::input_files(sequence, request.config);
  inputs.insert(inputs.end(), {calibration_file(request), request.config.file,
                               request.sequence_dir / "times.txt"});
  for (const fs::path& input : inputs) {
    std::error_code code;
    if (fs::equivalent(request.out_file, input, code)) {
      return fail(fmt::format("{}: expected a file to write that is no input, found {}",
                              request.out_file.string(), input.string()));
    }
  }
  return check_can_write(request.out_file);
}

Expected<PhasedOdometry> create_odometry(const CalibrationRequest& request, const Camera& camera) {
  Config config = request.config;
  config.odometry.mode = OdometryMode::kMap;
  config.scale.source = ScaleSource::kConstantSpeed;
  config.camera.refine = CameraRefinement::kAll;
  return PhasedOdometry::create(camera, config);
}

/// Runs the odometry over the sequence.
void drive(const KittiSequence& sequence,
           PhasedOdometry& odometry,
           const CalibrationProgress& progress,
           CalibrationReport& report) {
  const auto visit = [&](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& result) {
    if (!frame) {
      report.warnings.push_back(frame.error().message);
    } else if (!result.problem.empty()) {
      report.warnings.push_back(
          fmt::format("frame {}: {}", sequence.range().begin + i, result.problem));
    }
    report.interrupted = progress && !progress(i + 1, sequence.size());
    return !report.interrupted;
  };
  pipeline::run_frames(sequence, odometry, visit);
}

void read_estimate(const Camera& given, const CameraEstimate& estimate, CalibrationReport& report) {
  const auto parameter = [&](const char* name, double value, int i, double unit, double max_sigma) {
    const double sigma = unit * estimate.sigma[i];
    const double change = unit * estimate.change[i];
    const bool is_determined = sigma <= max_sigma;
    return CalibratedParameter{name,  value,     is_determined ? value + change : value,
                               sigma, max_sigma, is_determined};
  };
  const double f = given.fx_px;
  report.num_runs = estimate.num_bundles;
  report.parameters = {parameter("focal length", f, 2, f, kMaxSigmaOfFocal * f),
                       parameter("principal point x", given.cx_px, 0, 1.0, kMaxSigma_px),
                       parameter("principal point y", given.cy_px, 1, 1.0, kMaxSigma_px),
                       parameter("k1", 0.0, 3, 1.0, 1.0), parameter("k2", 0.0, 4, 1.0, 1.0)};
  report.refined = given;
  report.refined.fx_px = report.parameters[0].refined;
  report.refined.fy_px *= report.refined.fx_px / f;
  report.refined.cx_px = report.parameters[1].refined;
  report.refined.cy_px = report.parameters[2].refined;
}

Status write_calibration(const CalibrationRequest& request,
                         const Camera& given,
                         const Camera& refined) {
  const Expected<std::string> text =
      dataset::replace_kitti_camera(calibration_file(request), given, refined);
  return text ? write_text_file(request.out_file, *text) : Status(text.error());
}

}  // namespace

Expected<CalibrationReport> calibrate_sequence(const CalibrationRequest& request,
                                               const CalibrationProgress& progress) {
  const Expected<KittiSequence> sequence =
      KittiSequence::open(request.sequence_dir, {.camera = request.config.input.camera,
                                                 .frames = request.frames,
                                                 .calibration = calibration_file(request)});
  if (!sequence) {
    return sequence.error();
  }
  if (const Status status = check_request(request, *sequence); !status) {
    return status.error();
  }
  Expected<PhasedOdometry> odometry = create_odometry(request, sequence->camera());
  if (!odometry) {
    return odometry.error();
  }
  CalibrationReport report;
  drive(*sequence, *odometry, progress, report);
  if (report.interrupted) {
    return report;
  }
  read_estimate(sequence->camera(), odometry->frames().estimator().camera_estimate().value(),
                report);
  if (report.num_runs == 0) {
    return fail(fmt::format(
        "{}: expected frames that move for at least one run of {} keyframes, found "
        "none in {} frames",
        request.sequence_dir.string(), SelfCalibration::kNumKeyframes, sequence->size()));
  }
  if (std::any_of(report.parameters.begin(), report.parameters.begin() + 3,
                  std::mem_fn(&CalibratedParameter::is_determined))) {
    if (const Status status = write_calibration(request, sequence->camera(), report.refined);
        !status) {
      return status.error();
    }
    report.written = true;
  }
  return report;
}

std::string format_calibration_table(const CalibrationReport& report) {
  TextTable table("lrrrl");
  table.add({"px", "given", "refined", "sigma", "change"});
  table.rule();
  for (std::size_t i = 0; i < 3; ++i) {
    const CalibratedParameter& number = report.parameters[i];
    table.add({number.name, fmt::format("{:.2f}", number.given),
               fmt::format("{:.2f}", number.refined), fmt::format("{:.2f}", number.sigma),
               number.is_determined
                   ? fmt::format("{:+.2f} ({:+.2f} %)", number.refined - number.given,
                                 100.0 * (number.refined / number.given - 1.0))
                   : fmt::format("undetermined (sigma above {:.2f}): as given", number.max_sigma)});
  }
  const CalibratedParameter& k1 = report.parameters[3];
  const CalibratedParameter& k2 = report.parameters[4];
  return table.str() +
         fmt::format(
             "from {} runs of {} keyframes\nradial distortion left in the frames, which calib.txt "
             "cannot hold: k1 {:+.4f} +- {:.4f}, k2 {:+.4f} +- {:.4f}\n",
             report.num_runs, SelfCalibration::kNumKeyframes, k1.refined, k1.sigma, k2.refined,
             k2.sigma);
}

}  // namespace stemvo
