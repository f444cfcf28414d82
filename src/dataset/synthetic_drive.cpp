// SPDX-License-Identifier: MIT
#include "stemvo/dataset/synthetic_drive.hpp"

#include <algorithm>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "dataset/synth/drive.hpp"
#include "dataset/synth/drive_writer.hpp"
#include "dataset/synth/renderer.hpp"
#include "dataset/synth/walk.hpp"

namespace stemvo {
namespace {

constexpr int kMinSize_px = 16;
constexpr int kMaxSize_px = 8192;
constexpr int kMaxFrames = 1000000;  // %06d
constexpr double kMaxDrive_m_s = 60.0;
constexpr double kMaxWalk_m_s = 1.0;  // faster, and a turn on the spot would be a jerk

/// What the options leave open is set here.
struct Settings {
  synth::Pace pace;
  Camera camera;
};

template <typename Number>
Status check_number(const char* name, Number value, Number low, Number high) {
  if (!(value >= low && value <= high)) {
    return fail(fmt::format("synth: expected {} from {} to {}, found {}", name, low, high, value));
  }
  return {};
}

/// A street's knots are kept in memory.
Status check_way(const SyntheticDriveOptions& options, const Settings& settings) {
  constexpr double kMaxWay_m = 2e6;
  const double way_m = settings.pace.speed_m_s.value_or(1.0) / settings.pace.rate_hz *
                       static_cast<double>(options.num_frames);
  if (way_m > kMaxWay_m) {
    return fail(
        fmt::format("synth: expected a way of at most {} km (frames / rate * speed), "
                    "found {:.0f}",
                    kMaxWay_m / 1000.0, way_m / 1000.0));
  }
  return {};
}

Status check_options(const SyntheticDriveOptions& options, const Settings& settings) {
  if (options.trajectory && options.walk) {
    return fail("synth: expected a trajectory or a walk, found both");
  }
  if (options.trajectory && options.speed_m_s) {
    return fail("synth: expected a trajectory or a speed, found both (the poses say how fast)");
  }
  const double max_m_s = options.walk ? kMaxWalk_m_s : kMaxDrive_m_s;
  const double min_m_s = 0.1;
  return check_number("width", settings.camera.width_px, kMinSize_px, kMaxSize_px)
      .and_then([&] {
        return check_number("height", settings.camera.height_px, kMinSize_px, kMaxSize_px);
      })
      .and_then([&] { return check_number("frames", options.num_frames, 1, kMaxFrames); })
      .and_then([&] { return check_number("rate", settings.pace.rate_hz, 1.0, 1000.0); })
      .and_then([&] {
        return check_number("speed", options.speed_m_s.value_or(min_m_s), min_m_s, max_m_s);
      })
      .and_then([&] { return check_way(options, settings); });
}

/// The left colour camera of sequence 00, scaled to the picture's width.
Camera car_camera(int width_px, int height_px) {
  const double scale = width_px / 1241.0;
  Camera camera;
  camera.fx_px = camera.fy_px = 718.856 * scale;
  camera.cx_px = 607.1928 * scale;
  camera.cy_px = 185.2157 * height_px / 376.0;
  camera.width_px = width_px;
  camera.height_px = height_px;
  return camera;
}

/// f = 585 px at a width of 640 px.
Camera hand_camera(int width_px, int height_px) {
  Camera camera;
  camera.fx_px = camera.fy_px = 585.0 * width_px / 640.0;
  camera.cx_px = 0.5 * width_px;
  camera.cy_px = 0.5 * height_px;
  camera.width_px = width_px;
  camera.height_px = height_px;
  return camera;
}

Settings settings_of(const SyntheticDriveOptions& options) {
  if (options.walk) {
    return {{options.rate_hz.value_or(30.0), options.speed_m_s.value_or(synth::kWalkSpeed_m_s)},
            hand_camera(options.width_px.value_or(640), options.height_px.value_or(480))};
  }
  return {{options.rate_hz.value_or(10.0), options.speed_m_s},
          car_camera(options.width_px.value_or(1241), options.height_px.value_or(376))};
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
    return fail(poses.error().message);
  }
  poses->resize(std::min(poses->size(), static_cast<std::size_t>(options.num_frames)));
  return synth::make_drive_along(*poses, pace.rate_hz);
}

Status render_one(const synth::Renderer& renderer,
                  const synth::DriveWriter& writer,
                  std::size_t index,
                  bool with_depth) {
  const synth::RenderedFrame frame = renderer.render(index);
  const Status written = writer.write_image(index, frame.bgr);
  return written && with_depth ? writer.write_depth(index, frame.depth_m) : written;
}

Status write_cameras(const synth::DriveWriter& writer,
                     const Camera& camera,
                     double rate_hz,
                     bool with_camera_file) {
  const Status written = writer.write_calibration(camera);
  return written && with_camera_file ? writer.write_camera_file(camera, rate_hz) : written;
}

}  // namespace

Status render_synthetic_drive(const std::filesystem::path& out_dir,
                              const SyntheticDriveOptions& options,
                              const RenderProgress& progress) {
  const auto [pace, camera] = settings_of(options);
  if (const Status valid = check_options(options, {pace, camera}); !valid) {
    return valid;
  }
  auto path = plan_path(options, pace);
  if (!path) {
    return fail(path.error().message);
  }
  const auto writer = synth::DriveWriter::create(out_dir, options.name, options.write_depth);
  if (!writer) {
    return fail(writer.error().message);
  }
  if (const Status written = write_cameras(*writer, camera, pace.rate_hz, options.walk); !written) {
    return written;
  }
  const synth::Renderer renderer(std::move(*path), camera, options.seed);
  const Trajectory& poses = renderer.world_from_camera();
  const int total = static_cast<int>(poses.size());
  const int batch = std::max(1, cv::getNumThreads());  // frames at once: bounds the memory
  int done = 0;
  for (bool go_on = true; go_on && done < total;) {
    const int count = std::min(batch, total - done);
    std::vector<Status> results(static_cast<std::size_t>(count));
    cv::parallel_for_(cv::Range(0, count), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) {
        results[static_cast<std::size_t>(i)] =
            render_one(renderer, *writer, static_cast<std::size_t>(done + i), options.write_depth);
      }
    });
    for (const Status& result : results) {
      if (!result) {
        return result;
      }
    }
    done += count;
    go_on = !progress || progress(done, total);
  }
  return writer->write_truth(std::span(poses).first(static_cast<std::size_t>(done)), pace.rate_hz);
}

}  // namespace stemvo
