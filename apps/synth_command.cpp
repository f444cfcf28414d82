// SPDX-License-Identifier: MIT
#include <filesystem>
#include <functional>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "options.hpp"
#include "synth/synth.hpp"

namespace stemvo::apps {
namespace {

constexpr const char* kSynthFooter =
    R"(Writes OUT_DIR/sequences/NAME and OUT_DIR/poses/NAME.txt in KITTI's layout, with
exact poses. The same options give the same files.

Examples:
  stemvo synth drive --frames 200
  stemvo synth drive --trajectory kitti/poses/03.txt --frames 400 --seed 7
  stemvo synth walk --walk --frames 600
  stemvo synth walk --walk --frames 600 --visit 1 --name again
  stemvo synth hand --walk --blank-walls --turn-rate 200 --exposure 10 --readout 20 --auto-exposure
  stemvo synth street --traffic --frames 300
  stemvo synth drives --name street7 --seed 7   several drives in one folder)";

struct SynthArguments {
  std::filesystem::path out_dir;
  SyntheticDriveOptions options;
};

Expected<int> render(SynthArguments& arguments) {
  Progress progress("frames", /*is_quiet=*/false);
  const Status status =
      render_synthetic_drive(arguments.out_dir, arguments.options, std::ref(progress));
  if (is_interrupted()) {
    return kExitInterrupted;
  }
  if (!status) {
    return status.error();
  }
  const std::string& name = arguments.options.name;
  const std::string sequence = (arguments.out_dir / "sequences" / name).string();
  print(fmt::format("sequence: {}\n", sequence));
  print_json({{"sequence", sequence},
              {"poses", (arguments.out_dir / "poses" / (name + ".txt")).string()}});
  return kExitDone;
}

void add_options(CLI::App& command, SynthArguments& arguments) {
  SyntheticDriveOptions& options = arguments.options;
  command.add_option("OUT_DIR", arguments.out_dir, "Folder for the drive; created")
      ->required()
      ->type_name("");
  CLI::Option* trajectory =
      command
          .add_option("--trajectory", options.trajectory,
                      "Drive along these KITTI poses; default: a curve of its own")
          ->type_name("POSES");
  command
      .add_flag("--walk", options.walk,
                "Walk through a courtyard with the camera in the hand, in place of a drive")
      ->excludes(trajectory);
  command.add_option("--name", options.name, "The sequence's name; default 00")
      ->type_name("NAME")
      ->check([](const std::string& name) {
        const std::filesystem::path path(name);
        const bool is_name =
            path.has_filename() && path.filename() == path && name != "." && name != "..";
        return is_name ? "" : "expected the name of a folder, found '" + name + "'";
      });
  command.add_option("--frames", options.num_frames, "Frames to render; default 100")
      ->type_name("N")
      ->check(in_range(1, 1000000));
  command.add_option("--seed", options.seed, "Seed of textures, shading and noise; default 1")
      ->type_name("S")
      ->check(in_range(0.0, 0x1p64));  // CLI11 would wrap others around
  command
      .add_option("--visit", options.render.visit,
                  "The same place again, on another path and in other light (with the same "
                  "--trajectory, --frames, --seed); default 0: the first time")
      ->type_name("N")
      ->check(in_range(0, 1000000));
  CLI::Option* walk = command.get_option("--walk");
  command
      .add_flag("--traffic", options.render.traffic,
                "Cars, lorries and people that move; an own drive stands at crossings; also "
                "moving/NNNNNN.png: 255 where something moves")
      ->excludes(walk);
  command
      .add_flag("--blank-walls", options.render.blank_walls, "A walk between walls of one colour")
      ->needs(walk);
  command
      .add_option("--turn-rate", options.render.turn_rate_deg_s,
                  "A walk's turns on the spot, at their fastest; default 67 to 86")
      ->type_name("DEG_S")
      ->check(in_range(10.0, 400.0))
      ->needs(walk);
  command
      .add_option_function<double>(
          "--exposure", [&options](double ms) { options.render.exposure_s = 1e-3 * ms; },
          "Motion blur; the pose is that of the exposure's middle; default none")
      ->type_name("MS")
      ->check(in_range(0.0, 100.0));
  command
      .add_option_function<double>(
          "--readout", [&options](double ms) { options.render.readout_s = 1e-3 * ms; },
          "Rolling shutter, from the first row to the last; the pose is the middle row's; "
          "default none")
      ->type_name("MS")
      ->check(in_range(0.0, 100.0));
  command.add_flag("--small-chip", options.render.small_chip,
                   "A small camera's chip: point spread, gaps between pixels, photon and read "
                   "noise, response curve; default: an almost perfect one");
  command.add_flag("--auto-exposure", options.render.follows_light,
                   "Exposure that follows the light within half a second");
  command.add_option("--width", options.width_px, "Pixels; default 1241, with --walk 640")
      ->type_name("W")
      ->check(in_range(16, 8192));
  command.add_option("--height", options.height_px, "Pixels; default 376, with --walk 480")
      ->type_name("H")
      ->check(in_range(16, 8192));
  command.add_flag("--depth", options.write_depth,
                   "Also depth/NNNNNN.npy: metres along the optical axis, float32");
}

}  // namespace

CLI::App* add_synth(CLI::App& app, Action& action) {
  return add_command<SynthArguments>(
      app, action, {"synth", "Render a drive along a street, or a walk", kSynthFooter}, add_options,
      render);
}

}  // namespace stemvo::apps
