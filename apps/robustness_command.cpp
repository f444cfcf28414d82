// SPDX-License-Identifier: MIT
#include <algorithm>
#include <functional>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "progress.hpp"
#include "robustness/contenders.hpp"
#include "robustness/disturbance.hpp"
#include "robustness/robustness.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kRobustnessFooter =
    R"(Each drive runs as it is and under each disturbance, at three strengths, through
the configured channel and through controls: gray, log, census (and red, green,
blue where frames are colour), which differ in nothing but the channel, and orb
and sift, matched between pairs of frames of the gray image. Every step has its
true length (--set scale.source=camera_height: metres from the road instead).

--out receives robustness.csv (a line per disturbance, strength, channel and
drive), robustness.json (with the verdicts), robustness.txt (the tables) and
report.html (figures, for a browser), written after every row. The table shows
r_rel in degrees per 100 m, in brackets the share of frames with a measured
motion where some have none, and how many times as large the channel's rotation
error is as a control's over segments of an eighth of the path, from every frame
on, with the 95 % interval; * where the interval leaves out 1, else the two
cannot be told apart; - where there are too few segments. A second table sums up
groups of disturbances: geometric means of the ratios, and how many rows are
decided for whom.

Examples:
  stemvo robustness kitti/sequences/03 --out result
  stemvo robustness kitti/sequences/00 kitti/sequences/03 --kinds none,dusk,jpeg --controls gray --out result)";

struct RobustnessArguments {
  robustness::RobustnessRequest request;
  ConfigArguments config;
  bool is_quiet = false;
};

Expected<int> run(RobustnessArguments& arguments) {
  robustness::RobustnessRequest& request = arguments.request;
  Config base;
  base.scale_choice = ScaleChoice::kGroundTruth;
  STEMVO_TRY_GET(request.config, read_config(arguments.config, base));
  request.command = command_line();
  Progress progress("runs", arguments.is_quiet);
  request.progress = std::ref(progress);
  STEMVO_TRY_GET(const auto report, robustness::run_robustness(request));
  std::ranges::for_each(report.warnings, print_warning);
  if (!arguments.is_quiet) {
    print(robustness::format_table(report));
    print(fmt::format("report: {}\n", (request.out_dir / "report.html").string()));
  }
  print_json(robustness::document(report));
  if (report.interrupted) {
    print_warning("interrupted; the rows that were finished are written");
    return kExitInterrupted;
  }
  return kExitDone;
}

std::string kinds_help() {
  std::string help = "Only these; default: all. none: as the frames are";
  for (const robustness::Disturbance& one : robustness::disturbances()) {
    help += fmt::format("\n{}: {} ({})", one.name, one.effect, fmt::join(one.strengths, ", "));
  }
  return help;
}

void add_options(CLI::App& command, RobustnessArguments& arguments) {
  robustness::RobustnessRequest& request = arguments.request;
  command
      .add_option("SEQUENCE_DIR", request.sequence_dirs,
                  "Sequences in KITTI's layout, with ground truth")
      ->required()
      ->type_name("");
  add_out_folder(command, request.out_dir);
  add_range_option(command, "--frames", request.frames, "Frames A to B-1 of each sequence");
  command.add_option("--kinds", request.kinds, kinds_help())
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAME,..");
  command
      .add_option("--controls", request.controls,
                  fmt::format("Only these: some of {}, or other filters, MODEL:K",
                              fmt::join(robustness::all_controls(), ", ")))
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAME,..");
  add_threads_option(command, request.num_threads);
  command.add_flag("--quiet", arguments.is_quiet, "Only errors and warnings");
  add_config_options(command, arguments.config);
}

}  // namespace

CLI::App* add_robustness(CLI::App& app, Action& action) {
  return add_command<RobustnessArguments>(
      app, action, {"robustness", "Compare channels on disturbed frames", kRobustnessFooter},
      add_options, run);
}

}  // namespace stemvo::apps
