// SPDX-License-Identifier: MIT
#include "synth/synth.hpp"

#include <algorithm>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "synth/drive_folder.hpp"
#include "synth/renderer.hpp"

namespace stemvo {
namespace {

/// What the options leave open is set here.
struct Settings {
  synth::Pace pace;
  Camera camera;
};

Settings settings_of(const SyntheticDriveOptions& options) {
  const int width_px = options.width_px.value_or(options.walk ? 640 : 1241);
  const int height_px = options.height_px.value_or(options.walk ? 480 : 376);
  if (options.walk) {
    const double f_px = 585.0 * width_px / 640.0;
    return {{options.rate_hz.value_or(30.0), options.speed_m_s},
            {f_px, f_px, 0.5 * width_px, 0.5 * height_px, width_px, height_px}};
  }
  // The left colour camera of sequence 00, scaled to the image's width.
  const double scale = width_px / 1241.0;
  const double f_px = 718.856 * scale;
  return {{options.rate_hz.value_or(10.0), options.speed_m_s},
          {f_px, f_px, 607.1928 * scale, 185.2157 * height_px / 376.0, width_px, height_px}};
}

Expected<std::variant<synth::Drive, synth::Walk>> plan_path(const SyntheticDriveOptions& options,
                                                            const synth::Pace& pace) {
  if (options.walk) {
    return synth::make_walk(options.num_frames, options.seed, pace);
  }
  if (!options.trajectory) {
    return synth::make_own_drive(options.num_frames, options.seed, pace);
  }
  auto poses = read_kitti_trajectory(*options.trajectory);
  if (!poses) {
    return poses.error();
  }
  poses->resize(std::min(poses->size(), static_cast<std::size_t>(options.num_frames)));
  return synth::make_drive_along(*poses, pace.rate_hz);
}

/// Frames [begin, end), at once.
Status render_frames(const synth::Renderer& renderer,
                     const synth::DriveFolder& output,
                     cv::Range frames,
                     bool with_depth) {
  std::vector<Status> results(static_cast<std::size_t>(frames.size()));
  cv::parallel_for_(frames, [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) {
      const auto index = static_cast<std::size_t>(i);
      const synth::RenderedFrame frame = renderer.render(index);
      const Status written = output.write_image(index, frame.rgb);
      results[static_cast<std::size_t>(i - frames.start)] =
          written && with_depth ? output.write_depth(index, frame.depth_m) : written;
    }
  });
  const auto failed = std::ranges::find(results, false, &Status::has_value);
  return failed == results.end() ? Status() : *failed;
}

}  // namespace

Status check_options(const SyntheticDriveOptions& options) {
  if (options.trajectory && options.walk) {
    return fail("synth: expected a trajectory or a walk, found both");
  }
  if (options.trajectory && options.speed_m_s) {
    return fail("synth: expected a trajectory or a speed, found both (the poses say how fast)");
  }
  struct Limits {
    const char* name;
    double value;
    double low;
    double high;
  };
  const auto& [pace, camera] = settings_of(options);
  const double max_m_s = options.walk ? 1.0 : 60.0;  // faster, a turn on the spot would be a jerk
  for (const auto& [name, value, low, high] :
       {Limits{"width", 1.0 * camera.width_px, 16.0, 8192.0},
        Limits{"height", 1.0 * camera.height_px, 16.0, 8192.0},
        Limits{"frames", 1.0 * options.num_frames, 1.0, 1e6},  // %06d
        Limits{"rate", pace.rate_hz, 1.0, 1000.0},
        Limits{"speed", pace.speed_m_s.value_or(max_m_s), 0.1, max_m_s}}) {
    if (!(value >= low && value <= high)) {
      return fail(
          fmt::format("synth: expected {} from {} to {}, found {}", name, low, high, value));
    }
  }
  constexpr double kMaxWay_m = 2e6;  // a street's knots are kept in memory
  const double way_m = pace.speed_m_s.value_or(1.0) / pace.rate_hz * options.num_frames;
  if (way_m > kMaxWay_m) {
    return fail(
        fmt::format("synth: expected a way of at most {} km (frames / rate * speed), "
                    "found {:.0f}",
                    kMaxWay_m / 1000.0, way_m / 1000.0));
  }
  return {};
}

Status render_synthetic_drive(const std::filesystem::path& out_dir,
                              const SyntheticDriveOptions& options,
                              const RenderProgress& progress) {
  const Settings settings = settings_of(options);
  const auto& [pace, camera] = settings;
  if (const Status valid = check_options(options); !valid) {
    return valid;
  }
  auto path = plan_path(options, pace);
  if (!path) {
    return path.error();
  }
  const synth::DriveFolder output(out_dir, options.name);
  const auto lock = output.prepare(options.write_depth);
  Status status = lock ? output.write_calibration(camera) : Status(lock.error());
  if (status && options.walk) {
    status = output.write_camera_file(camera, pace.rate_hz);
  }
  if (!status) {
    return status;
  }
  const synth::Renderer renderer(std::move(*path), camera, options.seed);
  const Trajectory& poses = renderer.world_from_camera();
  const int total = static_cast<int>(poses.size());
  const int batch = std::max(1, cv::getNumThreads());  // frames at once: bounds the memory
  int done = 0;
  for (bool go_on = true; go_on && done < total;) {
    const cv::Range frames(done, std::min(done + batch, total));
    status = render_frames(renderer, output, frames, options.write_depth);
    if (!status) {
      return status;
    }
    done = frames.end;
    go_on = !progress || progress(static_cast<std::size_t>(done), poses.size());
  }
  if (done < total && output.has_earlier()) {
    return output.abandon();
  }
  const auto rendered = std::span(poses).first(static_cast<std::size_t>(done));
  status = output.write_truth(rendered, pace.rate_hz);
  return status ? output.finish() : status;
}

}  // namespace stemvo
