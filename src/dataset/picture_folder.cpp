// SPDX-License-Identifier: MIT
#include "dataset/picture_folder.hpp"

#include <span>

#include <fmt/format.h>

#include "dataset/camera_file.hpp"
#include "dataset/frame_files.hpp"
#include "dataset/kitti_text.hpp"
#include "dataset/picture_file.hpp"
#include "dataset/picture_list.hpp"
#include "stemvo/check.hpp"

namespace stemvo::dataset {
namespace {

namespace fs = std::filesystem;

/// Of all pictures.
Expected<std::vector<double>> read_times(const fs::path& file, std::size_t num_pictures) {
  auto times_s = read_kitti_times(file, num_pictures);
  if (times_s && times_s->size() != num_pictures) {
    return fail(fmt::format("{}: expected a time for each of {} pictures, found {} times",
                            file.string(), num_pictures, times_s->size()));
  }
  return times_s;
}

Expected<std::vector<double>> find_times(const FrameSourceRequest& request,
                                         const std::optional<double>& rate_hz,
                                         std::size_t num_pictures) {
  if (request.times) {
    return read_times(*request.times, num_pictures);
  }
  if (!rate_hz) {
    return fail(
        fmt::format("{}: expected rate_hz (frames per second) or --times FILE, found "
                    "neither",
                    request.camera_file->string()));
  }
  std::vector<double> times_s;
  for (std::size_t i = 0; i < num_pictures; ++i) {
    times_s.push_back(static_cast<double>(i) / *rate_hz);
  }
  return times_s;
}

Expected<Trajectory> read_poses(const fs::path& file,
                                const FrameRange& range,
                                std::size_t num_pictures) {
  const auto poses = read_kitti_trajectory(file);
  if (!poses) {
    return poses.error();
  }
  if (poses->size() != num_pictures) {
    return fail(fmt::format("{}: expected a pose for each of {} pictures, found {} poses",
                            file.string(), num_pictures, poses->size()));
  }
  return relative_to_first(std::span(*poses).subspan(range.begin, range.end - range.begin));
}

/// Whether the pictures are colour. Error: not of the camera file's size.
Expected<bool> check_pictures(const std::vector<fs::path>& files,
                              const fs::path& folder,
                              const fs::path& camera_file,
                              const Camera& camera) {
  const auto kind = vote_on_pictures<PictureKind>(files, read_picture_kind);
  if (!kind) {
    return kind.error();
  }
  if (kind->size != cv::Size(camera.width_px, camera.height_px)) {
    return fail(fmt::format("{}: expected pictures of {}x{} pixels, as {} says, found {}x{}",
                            folder.string(), camera.width_px, camera.height_px,
                            camera_file.string(), kind->size.width, kind->size.height));
  }
  return kind->is_color;
}

/// Files, times and poses, of the range.
Expected<FrameList> list_frames(const FrameSourceRequest& request,
                                const PictureList& pictures,
                                const std::optional<double>& rate_hz) {
  const std::size_t num_pictures = pictures.files.size();
  const auto range = resolve_range(request.frames, num_pictures, request.path);
  if (!range) {
    return range.error();
  }
  const auto times_s = find_times(request, rate_hz, num_pictures);
  if (!times_s) {
    return times_s.error();
  }
  FrameList frames;
  frames.name = absolute_folder(pictures.folder).filename().string();
  frames.range = *range;
  frames.given_calibration = request.camera_file;
  frames.files = cut(pictures.files, *range);
  frames.timestamps_s = cut(*times_s, *range);
  if (request.ground_truth) {
    auto poses = read_poses(*request.ground_truth, *range, num_pictures);
    if (!poses) {
      return poses.error();
    }
    frames.ground_truth = std::move(*poses);
    frames.ground_truth_file = request.ground_truth;
  }
  return frames;
}

}  // namespace

Expected<PictureFolder> PictureFolder::open(const FrameSourceRequest& request) {
  STEMVO_CHECK(request.camera_file.has_value(), "a camera file is given");
  const auto camera_file = read_camera_file(*request.camera_file);
  if (!camera_file) {
    return camera_file.error();
  }
  const auto pictures = list_pictures(request.path);
  if (!pictures) {
    return pictures.error();
  }
  auto frames = list_frames(request, *pictures, camera_file->rate_hz);
  if (!frames) {
    return frames.error();
  }
  const auto is_color = check_pictures(frames->files, pictures->folder, *request.camera_file,
                                       camera_file->lens.camera);
  if (!is_color) {
    return is_color.error();
  }
  auto undistortion = Undistortion::create(camera_file->lens);
  if (!undistortion) {
    return fail(fmt::format("{}: {}", request.camera_file->string(), undistortion.error().message));
  }
  frames->camera = undistortion->camera();
  frames->camera_height_m = camera_file->camera_height_m;
  return PictureFolder(std::move(*frames), std::move(*undistortion), *is_color);
}

Expected<cv::Mat> PictureFolder::read(std::size_t index) const {
  STEMVO_CHECK(index < size(), "frame index inside the range");
  const auto picture = read_picture(file(index), is_color_);
  if (!picture) {
    return picture;
  }
  if (const Status status = check_size(file(index), *picture, camera()); !status) {
    return status.error();
  }
  return undistortion_.apply(*picture);
}

}  // namespace stemvo::dataset
