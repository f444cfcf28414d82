// SPDX-License-Identifier: MIT
#include <algorithm>
#include <atomic>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "pipeline/run.hpp"
#include "report/metrics_json.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kRunFooter =
    R"(INPUT is one of
  KITTI/sequences/03    image_2/000000.png, .. (colour) or image_0 (gray),
                        calib.txt, times.txt; ground truth, where it exists, is
                        ../../poses/03.txt from there
  EUROC, or its mav0    cam0/data.csv, cam0/sensor.yaml,
                        state_groundtruth_estimate0/data.csv
  TUM                   rgb.txt, groundtruth.txt; the camera by --camera
  RECORDING             images/, camera.yaml, and where they exist times.txt
                        and poses.txt
  drive.mp4             a video, decoded by FFmpeg; the camera by --camera
  rtsp://HOST/PATH      a camera of the network (http, https too); --camera
  camera:0              /dev/video0, until Ctrl-C or the end of --frames; --camera

With --camera any folder of PNG or JPEG images in the order of their names
(frame2 before frame10), or a quoted pattern such as 'drive/left_*.png'.
camera.yaml says whose they are:

  image_width: 640
  image_height: 480
  intrinsics: [520.9, 521.0, 325.1, 249.7]    # fx, fy, cx, cy, pixels
  distortion_model: radial-tangential         # or none, or equidistant
  # k1, k2, p1, p2[, k3]; equidistant: k1, k2, k3, k4
  distortion_coefficients: [0.23, -0.78, -0.003, -0.0001, 0.92]
  rate_hz: 30                                 # or give --times
  camera_height: 1.65                         # metres above the road, if known

Also EuRoC's sensor.yaml, Kalibr's camchain.yaml, OpenCV's YAML and ROS'
camera_info. Frames are undistorted, and over 1.5 megapixels made smaller.
Without camera_height the path is up to scale (scale.source=none), but on KITTI
folders, where it is 1.65; --set scale.camera_height_m=1.4 says it too.

--out (a new results/NAME of INPUT without it) receives trajectory_kitti.txt and
trajectory_tum.txt (the poses as they came), trajectory_map_kitti.txt and
trajectory_map_tum.txt (as the map has them in the end, with its loops), map.ply
(landmarks and path), report.html (all there is to look at, for a browser),
trajectory.png (the path drawn), metrics.json (the numbers), frames.csv (a row
per frame) and config.yaml (what was run).

Examples:
  stemvo run kitti/sequences/03 --out result
the paper's protocol:
  stemvo run kitti/sequences/03 --out result --set scale.source=ground_truth
a second visit, localized in the map of the first:
  stemvo run visit1 --out first --save-map place.map
  stemvo run visit2 --out second --map place.map
on gray images, the first hundred:
  stemvo run kitti/sequences/03 --out gray --set stem.model=gray --frames 0:100
the paper's recipe, drawn:
  stemvo run kitti/sequences/03 --out paper --config paper --pictures 10
your own camera; a video, without the bonnet; a pattern:
  stemvo run drive/images --camera camera.yaml --out result
  stemvo run drive.mp4 --camera camera.yaml --mask 0,900,1920,180
  stemvo run 'left/*.png' --camera camera.yaml --times times.txt --out result)";

struct RunArguments {
  RunRequest request;
  ConfigArguments config;
  bool is_quiet = false;
  bool is_stream = false;
};

nlohmann::ordered_json row_of(std::size_t frame, const FrameResult& result, const Rigid3& pose) {
  const auto numbers = [](const auto& vector) {
    return std::vector<double>(vector.begin(), vector.end());
  };
  const Similarity3& map = result.map_from_world;
  return {{"frame", frame},
          {"timestamp_s", result.time_s},
          {"state", to_string(result.state)},
          {"is_measured", result.is_measured},
          {"position", numbers(pose.translation)},
          {"quaternion_xyzw", numbers(pose.rotation.coeffs())},
          {"step_variances", numbers(result.motion_covariance.diagonal())},
          {"scale_state", to_string(result.scale_state)},
          {"map_id", result.map_id},
          {"is_scale_new", result.is_scale_new},
          {"map_from_world",
           {{"scale", map.scale},
            {"position", numbers(map.translation)},
            {"quaternion_xyzw", numbers(map.rotation.coeffs())}}}};
}

Expected<int> run(RunArguments& arguments) {
  RunRequest& request = arguments.request;
  STEMVO_TRY_GET(request.config, read_config(arguments.config));
  request.command = command_line();
  request.started = process_start();
  if (!arguments.is_quiet) {
    request.note = print_line;
  }
  std::atomic<bool> is_read = true;
  if (arguments.is_stream) {
    choose_rows();
    request.on_frame = [&is_read](std::size_t frame, const FrameResult& result,
                                  const Rigid3& pose) {
      is_read = is_read && print_row(row_of(frame, result, pose));
    };
  }
  Progress progress("frames", arguments.is_quiet);
  const auto go_on = [&](std::size_t done, std::size_t total) {
    return progress(done, total) && is_read;
  };
  STEMVO_TRY_GET(const RunSummary summary, run_sequence(request, go_on));
  std::ranges::for_each(summary.warnings, print_warning);
  if (summary.interrupted) {
    print_warning(fmt::format("interrupted; the results hold the first {} frames",
                              summary.report.num_frames));
  }
  if (!summary.written) {
    return summary.written.error();
  }
  if (!arguments.is_quiet) {
    print(format_metrics_table(summary.report));
    if (summary.report.timing) {
      print('\n' + format_timing_table(*summary.report.timing) + '\n');
    }
    if (request.out_dir.empty()) {
      print(fmt::format("results: {}\n", summary.out_dir.string()));
    }
    print(fmt::format("report: {}\n", (summary.out_dir / "report.html").string()));
  }
  nlohmann::ordered_json json = metrics_document(summary.report);
  json["out_dir"] = summary.out_dir.string();
  json["interrupted"] = summary.interrupted;
  print_json(json);
  return summary.interrupted ? kExitInterrupted : kExitDone;
}

void add_options(CLI::App& command, RunArguments& arguments) {
  RunRequest& request = arguments.request;
  command
      .add_option(
          "INPUT", request.sequence_dir,
          "A recording: a folder, a video, a quoted pattern of images, camera:N (see below)")
      ->required()
      ->type_name("");
  command
      .add_option("--out", request.out_dir,
                  "Folder for the results; created; one of stemvo's is replaced, others are "
                  "refused; default: a new results/NAME of INPUT")
      ->type_name("DIR");
  add_config_options(command, arguments.config);
  add_range_option(command, "--frames", request.frames, "Frames A to B-1 only");
  add_file_option(command, "--gt", request.ground_truth,
                  "Ground truth: poses in KITTI's, TUM's or EuRoC's format");
  add_tolerance_option(command, request.ground_truth_tolerance_s);
  add_file_option(
      command, "--camera", request.camera_file,
      "Camera file; INPUT may be any folder of images, a pattern or a video (see below)");
  add_file_option(command, "--times", request.times,
                  "Of images: a time in seconds per image; default: counted from a rate");
  add_rate_option(command, request.rate_hz);
  add_file_option(command, "--calib", request.calibration,
                  "Calibration instead of the folder's calib.txt, e.g. of 'stemvo calibrate'");
  add_file_option(command, "--speed", request.speeds,
                  "Speeds of the camera: rows of time, m/s [, sigma]; lengths are metres then");
  add_file_option(command, "--gyro", request.gyro,
                  "Turn rates: rows of time and rad/s about x, y, z, in the IMU's axes (T_cam_imu "
                  "of a Kalibr file) or the camera's; or EuRoC's imu0/data.csv");
  command
      .add_option(
          "--mask", request.masks,
          "No points there: a rectangle of the frames in pixels, or an image of their size, "
          "black there; may be repeated")
      ->type_name("X,Y,WIDTH,HEIGHT|FILE")
      ->expected(1)
      ->take_all();
  command.add_option("--threads", request.num_threads, "Threads; 0 (default): all cores")
      ->type_name("N")
      ->check(in_range(0, 1024));
  command.add_option("--pictures", request.image_every, "Draw the tracks of every Nth frame")
      ->type_name("N")
      ->check(in_range(1, 1000000));
  add_file_option(command, "--video", request.video,
                  "Write a video of frames, tracks and path: .mp4, .mkv or .avi");
  add_file_option(
      command, "--map", request.map,
      "A map that --save-map wrote: the camera finds itself in it (map_* in frames.csv)");
  add_file_option(command, "--save-map", request.saved_map,
                  "Write what was remembered, with the places of --map");
  command.add_flag(
      "--adjust", request.adjust_map,
      "In the end adjust all keyframes, landmarks and the camera together, as is done "
      "where places were seen again: trajectory_map_*, map.ply and --save-map have it");
  command.add_flag("--timing", request.measure_times,
                   "Also where the time went: a table, and the key timing in metrics.json");
  command.add_flag("--stream", arguments.is_stream,
                   "A line of JSON per frame on standard output while it runs, all else on "
                   "standard error");
  command.add_flag("--quiet", arguments.is_quiet, "Only errors and warnings");
}

}  // namespace

CLI::App* add_run(CLI::App& app, Action& action) {
  return add_command<RunArguments>(
      app, action, {"run", "Reconstruct a drive from a recording", kRunFooter}, add_options, run);
}

}  // namespace stemvo::apps
