// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include "dataset/camera_file.hpp"
#include "dataset/frame_files.hpp"
#include "dataset/image_list.hpp"
#include "dataset/kitti_text.hpp"
#include "dataset/undistortion.hpp"
#include "io/image_file.hpp"

namespace stemvo::dataset {
namespace {

namespace fs = std::filesystem;

/// Of all images.
Expected<std::vector<double>> find_times(const FrameSourceRequest& request,
                                         const std::optional<double>& rate_hz,
                                         std::size_t num_images) {
  if (request.times) {
    auto read = read_kitti_times(*request.times, num_images);
    if (read && read->size() != num_images) {
      return fail(fmt::format("{}: expected a time for each of {} images, found {} times",
                              request.times->string(), num_images, read->size()));
    }
    return read;
  }
  if (!rate_hz) {
    return fail(
        fmt::format("{}: expected rate_hz (frames per second) or --times FILE, found "
                    "neither",
                    request.camera_file->string()));
  }
  std::vector<double> times_s;
  for (std::size_t i = 0; i < num_images; ++i) {
    times_s.push_back(static_cast<double>(i) / *rate_hz);
  }
  return times_s;
}

/// Whether the images are colour. Error: not of the camera file's size.
Expected<bool> check_images(const std::vector<fs::path>& files,
                            const fs::path& folder,
                            const fs::path& camera_file,
                            const Camera& camera) {
  const auto kind = vote_on_images(files, io::read_image_kind);
  if (!kind) {
    return kind.error();
  }
  if (kind->size != cv::Size(camera.width_px, camera.height_px)) {
    return fail(fmt::format("{}: expected images of {}x{} pixels, as {} says, found {}x{}",
                            folder.string(), camera.width_px, camera.height_px,
                            camera_file.string(), kind->size.width, kind->size.height));
  }
  return kind->is_color;
}

}  // namespace

Expected<FrameSource> open_image_folder(const FrameSourceRequest& request) {
  const auto camera_file = read_camera_file(*request.camera_file);
  if (!camera_file) {
    return camera_file.error();
  }
  const auto images = list_images(request.sequence_dir);
  if (!images) {
    return images.error();
  }
  const auto range =
      resolve_range(request.frames, images->files.size(), request.sequence_dir.string());
  if (!range) {
    return range.error();
  }
  const auto times_s = find_times(request, camera_file->rate_hz, images->files.size());
  if (!times_s) {
    return times_s.error();
  }
  auto frames = list_frames(*range, images->files, *times_s, request.ground_truth, true);
  if (!frames) {
    return frames.error();
  }
  const auto is_color =
      check_images(frames->files, images->folder, *request.camera_file, camera_file->lens.camera);
  if (!is_color) {
    return is_color.error();
  }
  auto undistortion = Undistortion::create(camera_file->lens);
  if (!undistortion) {
    return fail(fmt::format("{}: {}", request.camera_file->string(), undistortion.error().message));
  }
  frames->name = absolute_folder(images->folder).filename().string();
  frames->given_calibration = request.camera_file;
  frames->camera = undistortion->camera();
  frames->camera_height_m = camera_file->camera_height_m;
  frames->read = [files = frames->files, is_color = *is_color,
                  undistortion = *undistortion](std::size_t index) {
    const fs::path& file = files[index];
    return check_size(file, io::read_image(file, is_color), undistortion.camera())
        .map([&](const cv::Mat& image) { return undistortion.apply(image); });
  };
  return FrameSource(std::move(*frames));
}

}  // namespace stemvo::dataset
