// SPDX-License-Identifier: MIT
#include "stemvo/dataset/synthetic_drive.hpp"

#include <algorithm>
#include <vector>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "dataset/synth/drive.hpp"
#include "dataset/synth/drive_writer.hpp"
#include "dataset/synth/renderer.hpp"

namespace stemvo {
namespace {

constexpr int kMinSize_px = 16;
constexpr int kMaxSize_px = 8192;
constexpr int kMaxFrames = 1000000;  // %06d

Status check_options(const SyntheticDriveOptions& options) {
  const auto check = [](const char* name, int value, int low, int high) -> Status {
    if (value < low || value > high) {
      return fail(
          fmt::format("synth: expected {} from {} to {}, found {}", name, low, high, value));
    }
    return {};
  };
  return check("width", options.width_px, kMinSize_px, kMaxSize_px)
      .and_then([&] { return check("height", options.height_px, kMinSize_px, kMaxSize_px); })
      .and_then([&] { return check("frames", options.num_frames, 1, kMaxFrames); });
}

/// The left colour camera of sequence 00, scaled to the picture's width.
Camera scaled_camera(int width_px, int height_px) {
  const double scale = width_px / 1241.0;
  Camera camera;
  camera.fx_px = camera.fy_px = 718.856 * scale;
  camera.cx_px = 607.1928 * scale;
  camera.cy_px = 185.2157 * height_px / 376.0;
  camera.width_px = width_px;
  camera.height_px = height_px;
  return camera;
}

Expected<synth::Drive> plan_drive(const SyntheticDriveOptions& options) {
  if (!options.trajectory) {
    return synth::make_own_drive(options.num_frames, options.seed);
  }
  auto poses = read_kitti_trajectory(*options.trajectory);
  if (!poses) {
    return fail(poses.error().message);
  }
  poses->resize(std::min(poses->size(), static_cast<std::size_t>(options.num_frames)));
  return synth::make_drive_along(*poses);
}

Status render_one(const synth::Renderer& renderer,
                  const synth::DriveWriter& writer,
                  std::size_t index,
                  bool with_depth) {
  const synth::RenderedFrame frame = renderer.render(index);
  const Status written = writer.write_image(index, frame.bgr);
  return written && with_depth ? writer.write_depth(index, frame.depth_m) : written;
}

}  // namespace

Status render_synthetic_drive(const std::filesystem::path& out_dir,
                              const SyntheticDriveOptions& options,
                              const RenderProgress& progress) {
  if (const Status valid = check_options(options); !valid) {
    return valid;
  }
  auto drive = plan_drive(options);
  if (!drive) {
    return fail(drive.error().message);
  }
  const auto writer = synth::DriveWriter::create(out_dir, options.name, options.write_depth);
  if (!writer) {
    return fail(writer.error().message);
  }
  const Camera camera = scaled_camera(options.width_px, options.height_px);
  if (const Status written = writer->write_calibration(camera); !written) {
    return written;
  }
  const synth::Renderer renderer(std::move(*drive), camera, options.seed);
  const Trajectory& poses = renderer.drive().world_from_camera;
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
  return writer->write_truth(std::span(poses).first(static_cast<std::size_t>(done)));
}

}  // namespace stemvo
