// SPDX-License-Identifier: MIT
#include "calibration/calibrate.hpp"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>

#include <Eigen/QR>
#include <fmt/format.h>

#include "dataset/camera_file.hpp"
#include "dataset/frame_files.hpp"
#include "geometry/distortion.hpp"
#include "mapping/map_adjustment.hpp"
#include "mapping/pose_graph.hpp"
#include "odometry/phased_odometry.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"
#include "try.hpp"

namespace stemvo {
namespace fs = std::filesystem;

namespace {

/// Sigmas of any camera beforehand: principal point (px), focal length (share), k1, k2.
const IntrinsicsDelta kPriorSigma = (IntrinsicsDelta() << 30.0, 30.0, 0.2, 0.1, 0.1).finished();
/// A number less certain than this is not determined: px, and a share of the focal length. On a
/// straight drive an estimate with a sigma of 1.5 px was 6 px off.
constexpr double kMaxSigma_px = 1.25;
constexpr double kMaxSigmaOfFocal = 0.015;
constexpr double kMaxSigmaOfDistortion = 0.05;
/// Fewer keyframes do not tell a camera.
constexpr std::size_t kMinKeyframes = 8;

Expected<KeptMap> drive(const CalibrationRequest& request,
                        const FrameSource& sequence,
                        const RunProgress& progress,
                        CalibrationReport& report) {
  Config config = request.config;
  config.odometry.mode = OdometryMode::kMap;
  config.odometry.loops = true;
  config.scale.source = ScaleSource::kConstantSpeed;
  config.camera.refine = CameraRefinement::kAll;
  STEMVO_TRY_GET(PhasedOdometry odometry,
                 PhasedOdometry::create(sequence.camera, config, sequence.mask));
  const std::size_t num_frames = sequence.stream ? 0 : sequence.size();
  const auto visit = [&](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& result) {
    if (!frame) {
      report.warnings.push_back(frame.error().message);
    } else if (!result.problem.empty()) {
      report.warnings.push_back(
          fmt::format("frame {}: {}", sequence.range.begin + i, result.problem));
    }
    report.interrupted = progress && !progress(i + 1, num_frames);
    return !report.interrupted;
  };
  pipeline::run_frames(sequence, odometry, visit);
  return odometry.frames().estimator().kept_map();
}

std::optional<MapAdjustment> adjust(KeptMap map, const Camera& camera) {
  solve_pose_graph(map);
  map.lengths.clear();  // speeds that were assumed
  MapAdjustmentOptions options;
  options.camera = camera;
  options.camera_sigma = kPriorSigma;
  return adjust_map(map, options);
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
  report.parameters = {parameter("focal length", f, 2, f, kMaxSigmaOfFocal * f),
                       parameter("principal point x", given.cx_px, 0, 1.0, kMaxSigma_px),
                       parameter("principal point y", given.cy_px, 1, 1.0, kMaxSigma_px),
                       parameter("k1", 0.0, 3, 1.0, kMaxSigmaOfDistortion),
                       parameter("k2", 0.0, 4, 1.0, kMaxSigmaOfDistortion)};
}

/// The changes that are determined.
IntrinsicsDelta change_of(const CalibrationReport& report) {
  const auto change = [&](std::size_t i) {
    return report.parameters[i].refined - report.parameters[i].given;
  };
  IntrinsicsDelta result;
  result << change(1), change(2), change(0) / report.parameters[0].given, change(3), change(4);
  return result;
}

Status write_kitti(const fs::path& from,
                   const Camera& given,
                   const fs::path& out_file,
                   CalibrationReport& report) {
  report.refined = changed(given, change_of(report));
  const Expected<std::string> text = dataset::replace_kitti_camera(from, given, report.refined);
  return text ? write_text_file(out_file, *text) : Status(text.error());
}

Status write_camera(const fs::path& from,
                    const Camera& view,
                    const fs::path& out_file,
                    CalibrationReport& report) {
  STEMVO_TRY_GET(dataset::CameraFile file, dataset::read_camera_file(from));
  file.camera = refined_lens(file.camera, view, change_of(report));
  report.refined = file.camera;
  return write_text_file(out_file, dataset::camera_file_text(file));
}

/// A ray on the plane z = 1, and the pixel of the frame that shows it.
struct SeenRay {
  Eigen::Vector2d xy;
  Eigen::Vector2d uv;
};

/// IntrinsicsDelta, and the third and fourth coefficient of the lens: a centre that moves under a
/// strong lens looks like tangential distortion.
using LensDelta = Eigen::Matrix<double, 7, 1>;

Camera changed_lens(const Camera& lens, const LensDelta& by) {
  Camera camera = changed(lens, by.head<5>());
  for (int i = 0; i < 4; ++i) {
    camera.distortion_coefficients[static_cast<std::size_t>(i)] += by[3 + i];
  }
  return camera;
}

std::vector<SeenRay> seen_rays(const Camera& lens,
                               const Camera& view,
                               const IntrinsicsDelta& change) {
  Camera truth = changed(view, change);
  truth.distortion = Distortion::kRadialTangential;
  truth.distortion_coefficients = {change[3], change[4]};
  std::vector<SeenRay> rays;
  constexpr int kSteps = 20;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Eigen::Vector2d xy = truth.normalize(
          {view.width_px * i / double{kSteps}, view.height_px * j / double{kSteps}});
      rays.push_back(
          {xy, source_pixel(lens, view, truth.project(distort(truth, xy).homogeneous()))});
    }
  }
  return rays;
}

Eigen::VectorXd errors_of(const Camera& lens, const std::vector<SeenRay>& rays) {
  Eigen::VectorXd errors(2 * std::ssize(rays));
  Eigen::Index row = 0;
  for (const SeenRay& ray : rays) {
    errors.segment<2>(row) = lens.project(distort(lens, ray.xy).homogeneous()) - ray.uv;
    row += 2;
  }
  return errors;
}

}  // namespace

Expected<CalibrationReport> calibrate_sequence(const CalibrationRequest& request,
                                               const RunProgress& progress) {
  STEMVO_TRY(validate(request.config));
  FrameSourceRequest source = request;
  source.SequenceOptions::camera = request.config.input.camera;
  STEMVO_TRY_GET(const FrameSource sequence, open_source(source));
  STEMVO_TRY(check_can_write(request.out_file));
  CalibrationReport report;
  report.is_kitti = sequence.is_kitti;
  Expected<KeptMap> map = drive(request, sequence, progress, report);
  const auto remarks = sequence.remarks();
  report.warnings.insert(report.warnings.begin(), remarks.begin(), remarks.end());
  if (!map || report.interrupted) {
    return map ? Expected<CalibrationReport>(report) : map.error();
  }
  report.num_keyframes = map->keyframes.size();
  const auto adjusted = report.num_keyframes < kMinKeyframes
                            ? std::nullopt
                            : adjust(*std::move(map), sequence.camera);
  if (!adjusted) {
    return fail(fmt::format("{}: expected frames that move, found {} keyframes in {} frames",
                            request.sequence_dir.string(), report.num_keyframes, sequence.size()));
  }
  report.num_landmarks = adjusted->landmarks.size();
  report.median_error_px = adjusted->median_error_px;
  read_estimate(sequence.camera, adjusted->camera, report);
  if (std::any_of(report.parameters.begin(), report.parameters.begin() + 3,
                  std::mem_fn(&CalibratedParameter::is_determined))) {
    const auto write = report.is_kitti ? write_kitti : write_camera;
    const fs::path from = sequence.given_calibration.value_or(request.sequence_dir / "calib.txt");
    STEMVO_TRY(write(from, sequence.camera, request.out_file, report));
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
             "from {} keyframes and {} landmarks, which reproject at {:.2f} px (median)\nradial "
             "distortion left in the frames{}: k1 {:+.4f} +- {:.4f}, k2 {:+.4f} +- {:.4f}\n",
             report.num_keyframes, report.num_landmarks, report.median_error_px,
             report.is_kitti ? ", which calib.txt cannot hold" : "", k1.refined, k1.sigma,
             k2.refined, k2.sigma);
}

Camera refined_lens(const Camera& lens, const Camera& view, const IntrinsicsDelta& change) {
  const Camera working = working_camera(lens);
  const std::vector<SeenRay> rays = seen_rays(working, view, change);
  Camera fitted = working;
  if (fitted.distortion == Distortion::kNone) {
    fitted.distortion = Distortion::kRadialTangential;
  }
  constexpr int kIterations = 10;  // Gauss-Newton; the fit is all but linear
  for (int i = 0; i < kIterations; ++i) {
    const Eigen::VectorXd errors = errors_of(fitted, rays);
    Eigen::Matrix<double, Eigen::Dynamic, 7> jacobian(errors.size(), 7);
    constexpr double kStep = 1e-6;
    for (int c = 0; c < 7; ++c) {
      const Camera moved = changed_lens(fitted, kStep * LensDelta::Unit(c));
      jacobian.col(c) = (errors_of(moved, rays) - errors) / kStep;
    }
    fitted = changed_lens(fitted, -jacobian.colPivHouseholderQr().solve(errors));
  }
  const double size = static_cast<double>(lens.width_px) / working.width_px;
  Camera result = fitted;
  result.width_px = lens.width_px;
  result.height_px = lens.height_px;
  result.fx_px = lens.fx_px * fitted.fx_px / working.fx_px;
  result.fy_px = lens.fy_px * fitted.fy_px / working.fy_px;
  result.cx_px = lens.cx_px + size * (fitted.cx_px - working.cx_px);
  result.cy_px = lens.cy_px + size * (fitted.cy_px - working.cy_px);
  return result;
}

}  // namespace stemvo
