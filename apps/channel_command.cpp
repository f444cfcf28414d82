// SPDX-License-Identifier: MIT
#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "pipeline/run.hpp"
#include "try.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kChannelFooter =
    R"(For each frame --out receives NNNNNN_input.png, NNNNNN_filter_KKK.png and
NNNNNN_sheet.png, which shows them side by side.

Examples:
  stemvo channel kitti/sequences/03 --out images
  stemvo channel kitti/sequences/03 --out images --frames 100:110 --filters 0:4
  stemvo channel kitti/sequences/02 --out rgb --set stem.model=input_layer)";

struct ChannelArguments {
  ChannelImagesRequest request;
  ConfigArguments config;
};

Expected<int> draw(ChannelArguments& arguments) {
  STEMVO_TRY_GET(arguments.request.config, read_config(arguments.config));
  Progress progress("frames", /*is_quiet=*/false);
  STEMVO_TRY_GET(const ChannelImagesReport report,
                 write_channel_images(arguments.request, std::ref(progress)));
  std::ranges::for_each(report.warnings, print_warning);
  print(fmt::format("{} images in {}\n", report.num_written, arguments.request.out_dir.string()));
  print_json({{"images", report.num_written},
              {"out_dir", arguments.request.out_dir.string()},
              {"interrupted", is_interrupted()}});
  return is_interrupted() ? kExitInterrupted : kExitDone;
}

void add_options(CLI::App& command, ChannelArguments& arguments) {
  arguments.request.frames = FrameRangeRequest{0, 1};
  command
      .add_option("INPUT", arguments.request.sequence_dir,
                  "A recording: a folder, a video, a pattern of images (see 'stemvo run --help')")
      ->required()
      ->type_name("");
  command.add_option("--out", arguments.request.out_dir, "Folder for the images; created")
      ->required()
      ->type_name("DIR");
  add_range_option(command, "--frames", arguments.request.frames,
                   "Frames A to B-1; default: the first one");
  add_range_option(command, "--filters", arguments.request.filters,
                   "Filters A to B-1; default: all");
  add_file_option(command, "--camera", arguments.request.camera_file,
                  "Camera file of a recording that holds none");
  add_config_options(command, arguments.config);
}

}  // namespace

CLI::App* add_channel(CLI::App& app, Action& action) {
  return add_command<ChannelArguments>(
      app, action, {"channel", "Draw what the filters make of the frames", kChannelFooter},
      add_options, draw);
}

}  // namespace stemvo::apps
