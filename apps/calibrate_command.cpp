// SPDX-License-Identifier: MIT
#include <algorithm>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "calibration/calibrate.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kCalibrateFooter =
    R"(Runs the odometry, adjusts all keyframes, landmarks and the camera together and
writes down what that says of the camera: for KITTI's folders calib.txt, else
camera.yaml, with the distortion. Turns tell of it, a straight road does not: a
number that the recording does not determine stays as given and is marked.
Ground truth is not read. Nothing uses FILE unless it is given to a run.

With --board INPUT is pictures or a video of a printed board, and camera.yaml
says all of the camera; what to photograph next is printed, what parts of the
image lack is drawn beside it (camera_coverage.png). Boards:
  9x6:0.025                            a chessboard: inner corners, side (m)
  charuco:7x5:0.04:0.03:DICT_5X5_100   squares, sides, markers' side, dictionary
  aprilgrid:6x6:0.088:0.0264           tags, their side, the gap between them

Else INPUT is anything that 'stemvo run' takes. Examples:
  stemvo calibrate --board 9x6:0.025 photos --out camera.yaml
  stemvo calibrate kitti/sequences/00 --out refined.txt
  stemvo run kitti/sequences/00 --out result --calib refined.txt
  stemvo calibrate walk.mp4 --camera camera.yaml --out refined.yaml)";

struct CalibrateArguments {
  CalibrationRequest request;
  std::string board;  ///< empty: by a drive
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
  std::ranges::for_each(report.warnings, print_warning);
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

nlohmann::ordered_json document(const std::string& file, const BoardReport& report) {
  auto views = nlohmann::ordered_json::array();
  for (const BoardView& view : report.views) {
    views.push_back({{"name", view.name}, {"error_px", view.error_px}, {"used", view.is_used}});
  }
  auto parameters = nlohmann::ordered_json::array();
  for (const FittedNumber& one : report.fit.numbers) {
    parameters.push_back({{"name", one.name}, {"value", one.value}, {"sigma", one.sigma}});
  }
  return {{"written", !report.interrupted},
          {"file", file},
          {"coverage", report.coverage_file.string()},
          {"error_px", report.fit.error_px},
          {"pictures", report.num_pictures},
          {"views", views},
          {"missing", report.missing},
          {"parameters", parameters}};
}

Expected<int> by_board(const CalibrateArguments& arguments) {
  const std::string file = arguments.request.out_file.string();
  STEMVO_TRY_GET(const Board board, parse_board(arguments.board));
  const BoardRequest request{arguments.request.sequence_dir, arguments.request.out_file, board,
                             arguments.board};
  Progress progress("pictures", arguments.is_quiet);
  STEMVO_TRY_GET(const BoardReport result, calibrate_board(request, std::ref(progress)));
  std::ranges::for_each(result.warnings, print_warning);
  if (result.interrupted) {
    print_warning(fmt::format("interrupted; {} was not written", file));
    return kExitInterrupted;
  }
  if (!arguments.is_quiet) {
    print(format_board_table(result) +
          fmt::format("camera: {}\ncoverage: {}\n", file, result.coverage_file.string()));
  }
  print_json(document(file, result));
  return kExitDone;
}

Expected<int> calibrate(CalibrateArguments& arguments) {
  if (!arguments.board.empty()) {
    return by_board(arguments);
  }
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
  CLI::Option* const board =
      command.add_option("--board", arguments.board, "Printed board that INPUT shows (see below)")
          ->type_name("BOARD");
  board->excludes(
      add_file_option(command, "--camera", request.camera_file, "Camera file to start from"));
  board->excludes(
      add_file_option(command, "--times", request.times, "Of images: a time in seconds per image"));
  board->excludes(add_rate_option(command, request.rate_hz));
  board->excludes(add_file_option(command, "--calib", request.calibration,
                                  "Calibration to start from; default: the folder's calib.txt"));
  board->excludes(add_range_option(command, "--frames", request.frames, "Frames A to B-1 only"));
  add_config_options(command, arguments.config);
  command.add_flag("--quiet", arguments.is_quiet, "Only errors and warnings");
}

}  // namespace

CLI::App* add_calibrate(CLI::App& app, Action& action) {
  return add_command<CalibrateArguments>(
      app, action,
      {"calibrate", "Find the camera by a printed board or a recording", kCalibrateFooter},
      add_options, calibrate);
}

}  // namespace stemvo::apps
