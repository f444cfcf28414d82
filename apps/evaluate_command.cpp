// SPDX-License-Identifier: MIT
#include <string>

#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "report/evaluate_report.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kEvaluateFooter =
    R"(Pose files are KITTI's (12 numbers a line), TUM's (8) or EuRoC's
(state_groundtruth_estimate0/data.csv, the body's pose, which T_BS of
../cam0/sensor.yaml, or of --camera, makes the camera's). Where both files have
times, each pose is compared with the true one nearest in time; else line by
line, the estimate's with all of the ground truth's or with those of --frames.
Both trajectories are moved to start at the identity; nothing else is fitted
unless --align says so.

Examples:
  stemvo evaluate --gt kitti/poses/03.txt result/trajectory_kitti.txt
  stemvo evaluate --gt mav0/state_groundtruth_estimate0/data.csv result/trajectory_tum.txt --align sim3
  stemvo evaluate --gt kitti/poses/03.txt --frames 0:400 result/trajectory_kitti.txt
  stemvo evaluate --gt kitti/poses/03.txt a.txt b.txt --align sim3 --json > numbers.json
  stemvo evaluate --gt kitti/poses/03.txt a.txt --json | jq .estimates[0].t_rel_percent)";

struct EvaluateArguments {
  EvaluationRequest request;
  std::string alignment = "none";
};

Expected<int> evaluate(EvaluateArguments& arguments) {
  arguments.request.alignment = parse_alignment(arguments.alignment).value();
  STEMVO_TRY_GET(const EvaluationReport report, evaluate_files(arguments.request));
  print(format_evaluation_table(report));
  print_json(evaluation_document(report));
  return kExitDone;
}

void add_options(CLI::App& command, EvaluateArguments& arguments) {
  command
      .add_option("--gt", arguments.request.ground_truth,
                  "Ground truth: KITTI's, TUM's or EuRoC's poses")
      ->required()
      ->type_name("POSES");
  command.add_option("ESTIMATE", arguments.request.estimates, "Trajectories to judge")
      ->required()
      ->type_name("");
  command.add_option("--align", arguments.alignment, "none (default), scale, se3 or sim3")
      ->type_name("KIND")
      ->check(CLI::IsMember({"none", "scale", "se3", "sim3"}));
  add_range_option(command, "--frames", arguments.request.frames,
                   "Poses A to B-1 of the ground truth only");
  add_tolerance_option(command, arguments.request.tolerance_s);
  add_file_option(command, "--camera", arguments.request.camera_file,
                  "With EuRoC's poses: the camera file with T_BS");
}

}  // namespace

CLI::App* add_evaluate(CLI::App& app, Action& action) {
  return add_command<EvaluateArguments>(
      app, action, {"evaluate", "Compare trajectories with the ground truth", kEvaluateFooter},
      add_options, evaluate);
}

}  // namespace stemvo::apps
