// SPDX-License-Identifier: MIT
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "calibration/calibrate.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "progress.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kCalibrateFooter =
    R"(Runs the odometry, adjusts all keyframes, landmarks and the camera together and
writes down what that says of the camera: for KITTI's folders calib.txt, else
camera.yaml, with the distortion. Turns tell of it, a straight road does not: a
number that the recording does not determine stays as given and is marked.
Ground truth is not read. Nothing uses FILE unless it is given to a run.

INPUT is anything that 'stemvo run' takes. Examples:
  stemvo calibrate kitti/sequences/00 --out refined.txt
  stemvo run kitti/sequences/00 --out result --calib refined.txt
  stemvo calibrate walk.mp4 --camera camera.yaml --out refined.yaml)";

struct CalibrateArguments {
  CalibrationRequest request;
  ConfigArguments config;
  bool is_quiet = false;
};

nlohmann::ordered_json document(const CalibrateArguments& arguments,
                                const CalibrationReport& report) {
  auto parameters = nlohmann::ordered_json::array();
  for (const CalibratedParameter& one : report.parameters) {
    parameters.push_back({{"name", one.name},
                          {"given", one.given},
                          {"refined", one.refined},
                          {"sigma", one.sigma},
                          {"determined", one.is_determined}});
  }
  return {{"written", report.written},
          {"file", arguments.request.out_file.string()},
          {"keyframes", report.num_keyframes},
          {"landmarks", report.num_landmarks},
          {"median_error_px", report.median_error_px},
          {"parameters", parameters}};
}

int report(const CalibrateArguments& arguments, const CalibrationReport& report) {
  const std::string file = arguments.request.out_file.string();
  for (const std::string& warning : report.warnings) {
    print_warning(warning);
  }
  if (report.interrupted) {
    print_warning(fmt::format("interrupted; {} was not written", file));
    return kExitInterrupted;
  }
  if (!arguments.is_quiet) {
    print(format_calibration_table(report));
  }
  print_json(document(arguments, report));
  if (!report.written) {
    print_error(
        fmt::format("{}: not written: expected a drive that determines the focal length "
                    "or the principal point (turns do), found one that determines neither",
                    file));
    return kExitFailed;
  }
  if (!arguments.is_quiet) {
    print(fmt::format("calibration: {}\n", file));
  }
  return kExitDone;
}

Expected<int> calibrate(CalibrateArguments& arguments) {
  CalibrationRequest& request = arguments.request;
  STEMVO_TRY_GET(request.config, read_config(arguments.config));
  Progress progress("frames", arguments.is_quiet);
  STEMVO_TRY_GET(const CalibrationReport result, calibrate_sequence(request, std::ref(progress)));
  return report(arguments, result);
}

void add_options(CLI::App& command, CalibrateArguments& arguments) {
  CalibrationRequest& request = arguments.request;
  command
      .add_option("INPUT", request.sequence_dir,
                  "A recording: a folder, a video, a quoted pattern of images")
      ->required()
      ->type_name("");
  command
      .add_option("--out", request.out_file,
                  "File for the calibration: calib.txt of KITTI's folders, else camera.yaml")
      ->required()
      ->type_name("FILE");
  add_file_option(command, "--camera", request.camera_file, "Camera file to start from");
  add_file_option(command, "--times", request.times, "Of images: a time in seconds per image");
  add_rate_option(command, request.rate_hz);
  add_file_option(command, "--calib", request.calibration,
                  "Calibration to start from; default: the folder's calib.txt");
  add_range_option(command, "--frames", request.frames, "Frames A to B-1 only");
  add_config_options(command, arguments.config);
  command.add_flag("--quiet", arguments.is_quiet, "Only errors and warnings");
}

}  // namespace

CLI::App* add_calibrate(CLI::App& app, Action& action) {
  return add_command<CalibrateArguments>(
      app, action, {"calibrate", "Find the camera by a recording", kCalibrateFooter}, add_options,
      calibrate);
}

}  // namespace stemvo::apps
