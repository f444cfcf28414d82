// SPDX-License-Identifier: MIT
#include <algorithm>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "progress.hpp"
#include "search/search.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kSearchFooter =
    R"(Every filter of the model (and, for comparison, ORB on the gray image and the
input's R, G and B) is given an odometry of its own, each step having its true
length. First come the filters that cannot be told from the best (paired
bootstrap over segments, 95 %), a group of equals, then the others by t_rel.
--kinds has disturbed sequences count too. Ground truth is needed. Hopeless
filters are stopped early (successive halving); --exhaustive runs all to the
end.

--out receives filters.csv and filters.json (the table), config.yaml (the
odometry of all rows), best.yaml (for 'stemvo run --config'), report.html,
sheet.png (best, median, worst, baselines) and records.jsonl, from which
--resume goes on after Ctrl-C or a crash.

Examples:
  stemvo search kitti/sequences/00 --model stems/efficientnet.onnx --out result
  stemvo search kitti/sequences/00 kitti/sequences/03 --kinds dusk,motion_blur --out result
  stemvo search kitti/sequences/00 --frames 0:100 --held-out kitti/sequences/03 --out result
part of a layer, and such parts to one table:
  stemvo search kitti/sequences/00 --exhaustive --filters 0:8 --out part0
  stemvo search --merge part0 part1 --out result)";

struct SearchArguments {
  search::SearchRequest request;
  ConfigArguments config;
  std::vector<std::filesystem::path> merge;
  bool is_quiet = false;
  bool was_stopped = false;  ///< while records were read
};

Expected<search::SearchReport> find_filters(SearchArguments& arguments) {
  search::SearchRequest& request = arguments.request;
  request.is_stopped = [&arguments] { return arguments.was_stopped = is_interrupted(); };
  if (!arguments.merge.empty()) {
    return search::merge_searches(arguments.merge, request.out_dir, command_line(),
                                  request.is_stopped);
  }
  STEMVO_TRY_GET(request.config, read_config(arguments.config, search::search_defaults()));
  for (const std::string& assignment : arguments.config.overrides) {
    const std::string key = assignment.substr(0, assignment.find('='));
    if (key == "stem.model" || key == "stem.filter") {
      return fail(
          fmt::format("--set {}: expected --model or --filters, which say what a search "
                      "runs, found '{}'",
                      key, assignment));
    }
  }
  request.command = command_line();
  Progress progress("filter-frames", arguments.is_quiet);
  return search::run_search(request, std::ref(progress));
}

Expected<int> run(SearchArguments& arguments) {
  const search::SearchRequest& request = arguments.request;
  if (arguments.merge.empty() == request.sequence_dirs.empty()) {
    print_error("expected either SEQUENCE_DIR or --merge with parts (see 'stemvo search --help')");
    return kExitUsage;
  }
  const Expected<search::SearchReport> report = find_filters(arguments);
  if (!report && arguments.was_stopped) {
    print_warning(report.error().message);
    return kExitInterrupted;
  }
  if (!report) {
    return report.error();
  }
  std::ranges::for_each(report->warnings, print_warning);
  if (!arguments.is_quiet) {
    print(report->text);
  }
  print_json(nlohmann::ordered_json::parse(report->json));
  if (report->interrupted) {
    print_warning("interrupted; what is done is kept, --resume goes on from there");
    return kExitInterrupted;
  }
  return kExitDone;
}

void add_options(CLI::App& command, SearchArguments& arguments) {
  search::SearchRequest& request = arguments.request;
  command
      .add_option("SEQUENCE_DIR", request.sequence_dirs,
                  "Sequences in KITTI's layout, with ground truth; all of them rank")
      ->type_name("");
  add_out_folder(command, request.out_dir);
  command
      .add_option("--model", request.models,
                  "Built-in models or paths of .onnx files, e.g. a.onnx,b.onnx; default: default")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("MODEL,..");
  command
      .add_option("--kinds", request.kinds,
                  "Each sequence also under these disturbances, at their middle strength "
                  "(stemvo robustness --help lists them)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAME,..");
  add_range_option(command, "--filters", request.filters,
                   "Filters A to B-1 of each model; default: all");
  add_range_option(command, "--frames", request.frames, "Frames A to B-1 of each sequence");
  command
      .add_option("--held-out", request.held_out_dir, "A sequence that is reported, not ranked by")
      ->type_name("DIR");
  add_range_option(command, "--held-out-frames", request.held_out_frames,
                   "Frames A to B-1 of the held-out sequence")
      ->needs("--held-out");
  command.add_flag("--exhaustive", request.exhaustive, "Every filter over every frame");
  command
      .add_option("--only-sequence", request.only_sequence,
                  "Run the K-th sequence only (from 0, the held-out one last): a part for --merge")
      ->type_name("K")
      ->check(in_range(0, 100000));
  command.add_flag("--resume", request.resume, "Go on with the search in --out, if there is one");
  command.add_flag_callback(
      "--no-baselines", [&request] { request.baselines = false; }, "Only the model's filters");
  command
      .add_option("--merge", arguments.merge,
                  "Join parts of one exhaustive search (folders --out) into --out")
      ->type_name("DIR..");
  command
      .add_option(
          "--block", request.block,
          "Filters in flight: what a kill may lose. One pass of the stem serves a block, so the "
          "default is a whole layer, as far as about 1 GB allows")
      ->type_name("FILTERS")
      ->check(in_range(1, 100000));
  add_threads_option(command, request.num_threads);
  command.add_flag("--quiet", arguments.is_quiet, "Only errors and warnings");
  add_config_options(command, arguments.config);
  // A merge takes everything but --out from the parts.
  const std::set<std::string> shared = {"--merge", "--help", "--version", "--out", "--quiet"};
  for (CLI::Option* option : command.get_options()) {
    if (!shared.contains(option->get_name())) {
      command.get_option("--merge")->excludes(option);
    }
  }
}

}  // namespace

CLI::App* add_search(CLI::App& app, Action& action) {
  return add_command<SearchArguments>(
      app, action, {"search", "Find the best filter of a network", kSearchFooter}, add_options,
      run);
}

}  // namespace stemvo::apps
