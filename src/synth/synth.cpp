// SPDX-License-Identifier: MIT
#include "synth/synth.hpp"

#include <algorithm>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "io/png.hpp"
#include "pipeline/out_folder.hpp"
#include "synth/renderer.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

Camera camera_of(const SyntheticDriveOptions& options) {
  const int width_px = options.width_px.value_or(options.walk ? 640 : 1241);
  const int height_px = options.height_px.value_or(options.walk ? 480 : 376);
  if (options.walk) {
    const double f_px = 585.0 * width_px / 640.0;
    return {f_px, f_px, 0.5 * width_px, 0.5 * height_px, width_px, height_px};
  }
  // The left colour camera of KITTI's sequence 00, scaled to the image's width.
  const double scale = width_px / 1241.0;
  const double f_px = 718.856 * scale;
  return {f_px, f_px, 607.1928 * scale, 185.2157 * height_px / 376.0, width_px, height_px};
}

Expected<synth::CameraPath> plan_path(const SyntheticDriveOptions& options) {
  if (options.walk) {
    return synth::make_walk(options.num_frames, options.seed, options.render);
  }
  Trajectory given;
  if (options.trajectory) {
    STEMVO_TRY_GET(given, read_kitti_trajectory(*options.trajectory));
    given.resize(std::min(given.size(), static_cast<std::size_t>(options.num_frames)));
  }
  synth::Drive drive = options.trajectory ? synth::make_drive_along(given)
                                          : synth::make_own_drive(options.num_frames, options.seed,
                                                                  options.render.traffic);
  if (options.render.visit > 0) {
    synth::drive_again(options.seed, options.render.visit, drive);
  }
  return drive;
}

struct DriveFolder {  // OUT/sequences/NAME and OUT/poses/NAME.txt
  fs::path sequence;
  fs::path poses;
};

/// Makes the folders, empty. Error: what is there was not rendered.
Status open_folder(const DriveFolder& drive, const SyntheticDriveOptions& options) {
  std::error_code code;
  if (is_there(drive.poses) && !pipeline::is_folder_of(drive.sequence, "synth")) {
    return fail(fmt::format(
        "{}: expected poses of a rendered drive or none, found others (--name gives another name)",
        drive.poses.string()));
  }
  STEMVO_TRY(pipeline::open_out_folder(drive.sequence, "synth"));
  for (const char* content : {"image_2", "depth", "moving", "times.txt"}) {
    fs::remove_all(drive.sequence / content, code);
  }
  fs::create_directory(drive.sequence / "image_2", code);
  if (options.write_depth) {
    fs::create_directory(drive.sequence / "depth", code);
  }
  if (options.render.traffic) {
    fs::create_directory(drive.sequence / "moving", code);
  }
  return pipeline::create_out_folder(drive.poses.parent_path());
}

/// NumPy format 1.0, little-endian float32, rows first.
std::string encode_npy(const cv::Mat& values) {
  // Magic, version and the length of the header, which fills 128 bytes with them and a newline.
  std::string bytes("\x93NUMPY\x01\x00\x76\x00", 10);
  bytes += fmt::format(
      "{:117}\n", fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}",
                              values.rows, values.cols));
  bytes.append(reinterpret_cast<const char*>(values.data), values.total() * sizeof(float));
  return bytes;
}

Status render_frames(const synth::Renderer& renderer,
                     const fs::path& sequence,
                     cv::Range frames,
                     const SyntheticDriveOptions& options) {
  std::vector<Status> results(static_cast<std::size_t>(frames.size()));
  cv::parallel_for_(frames, [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      const synth::RenderedFrame frame = renderer.render(static_cast<std::size_t>(i));
      Status& result = results[static_cast<std::size_t>(i - frames.start)];
      // Noise does not compress: the fastest level costs a few per cent of size.
      result = write_text_file(sequence / fmt::format("image_2/{:06}.png", i),
                               io::encode_png(frame.rgb, true));
      if (result && options.render.traffic) {
        result = write_text_file(sequence / fmt::format("moving/{:06}.png", i),
                                 io::encode_png(frame.moving));
      }
      if (result && options.write_depth) {
        result = write_text_file(sequence / fmt::format("depth/{:06}.npy", i),
                                 encode_npy(frame.depth_m));
      }
    }
  });
  const auto failed = std::ranges::find(results, false, &Status::has_value);
  return failed == results.end() ? Status() : *failed;
}

/// calib.txt with the same intrinsics in P0 to P3, no baseline; the poses, moved so that the first
/// one is the identity; times.txt.
Status write_texts(const DriveFolder& drive,
                   const Camera& camera,
                   std::span<const Rigid3> world_from_camera,
                   double rate_hz) {
  std::string calibration;
  for (int i = 0; i < 4; ++i) {
    calibration += fmt::format("P{}: {:.12e} 0 {:.12e} 0 0 {:.12e} {:.12e} 0 0 0 1 0\n", i,
                               camera.fx_px, camera.cx_px, camera.fy_px, camera.cy_px);
  }
  const int digits = rate_hz == 10.0 ? 6 : 12;  // KITTI's own number of digits where it is exact
  std::string times;
  for (std::size_t i = 0; i < world_from_camera.size(); ++i) {
    times += fmt::format("{:.{}e}\n", static_cast<double>(i) / rate_hz, digits);
  }
  STEMVO_TRY(write_text_file(drive.sequence / "calib.txt", calibration));
  STEMVO_TRY(write_kitti_trajectory(drive.poses, relative_to_first(world_from_camera)));
  return write_text_file(drive.sequence / "times.txt", times);
}

}  // namespace

Status render_synthetic_drive(const fs::path& out_dir,
                              const SyntheticDriveOptions& options,
                              const RenderProgress& progress) {
  STEMVO_TRY_GET(auto path, plan_path(options));
  const DriveFolder drive{out_dir / "sequences" / options.name,
                          out_dir / "poses" / (options.name + ".txt")};
  STEMVO_TRY(open_folder(drive, options));
  const Camera camera = camera_of(options);
  const synth::Renderer renderer(std::move(path), camera, options.seed, options.render);
  const Trajectory& poses = renderer.world_from_camera();
  const int total = static_cast<int>(poses.size());
  const int batch = std::max(1, cv::getNumThreads());  // frames at once: bounds the memory
  int done = 0;
  for (bool go_on = true; go_on && done < total;) {
    const cv::Range frames(done, std::min(done + batch, total));
    STEMVO_TRY(render_frames(renderer, drive.sequence, frames, options));
    done = frames.end;
    go_on = !progress || progress(static_cast<std::size_t>(done), poses.size());
  }
  return write_texts(drive, camera, std::span(poses).first(static_cast<std::size_t>(done)),
                     renderer.rate_hz());
}

}  // namespace stemvo
