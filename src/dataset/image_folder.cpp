// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include "dataset/camera_file.hpp"
#include "dataset/frame_files.hpp"
#include "dataset/kitti_text.hpp"
#include "io/image_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace {

namespace fs = std::filesystem;

/// The times of all images, where something says them.
Expected<TimedRows<double>> find_times(const Listing& listing, const FrameSourceRequest& request) {
  const std::size_t num_images = listing.files.size();
  const auto& file = request.times ? request.times : listing.times_file;
  if (request.rate_hz && (file || !listing.times_s.empty())) {
    return fail(fmt::format("--rate {}: expected images without times, found {}", *request.rate_hz,
                            file ? file->string() : "those of the list of images"));
  }
  if (!file) {
    return TimedRows<double>{listing.times_s, listing.note};
  }
  auto read = read_kitti_times(*file, num_images);
  if (read && read->rows.size() != num_images) {
    return fail(fmt::format("{}: expected a time for each of {} images, found {} times",
                            file->string(), num_images, read->rows.size()));
  }
  return read;
}

/// Error: images that are not of the camera file's size.
Expected<SharedKind> check_images(FrameSource& frames,
                                  const fs::path& folder,
                                  const fs::path& camera_file,
                                  const Camera& camera) {
  STEMVO_TRY_GET(const auto kind, vote_on_images(frames));
  if (kind.size != cv::Size(camera.width_px, camera.height_px)) {
    return fail(
        fmt::format("{}: expected images of {}x{} pixels, as {} says, found {}x{}; "
                    "give the camera file of that size",
                    folder.string(), camera.width_px, camera.height_px, camera_file.string(),
                    kind.size.width, kind.size.height));
  }
  return kind;
}

}  // namespace

Expected<FrameSource> open_listing(const Listing& listing, const FrameSourceRequest& request) {
  const auto camera_path = request.camera_file ? request.camera_file : listing.camera_file;
  if (!camera_path) {
    return fail(
        fmt::format("{}: a {}: expected --camera FILE or camera.yaml in it, found neither; "
                    "'stemvo run --help' shows what it holds",
                    request.sequence_dir.string(), listing.kind));
  }
  STEMVO_TRY_GET(const auto camera_file, read_camera_file(*camera_path));
  STEMVO_TRY_GET(const auto range, resolve_range(request.frames, listing.files.size(),
                                                 request.sequence_dir.string()));
  STEMVO_TRY_GET(auto times, find_times(listing, request));
  const bool has_times = !times.rows.empty();
  times.rows.resize(listing.files.size());
  FrameSource frames = list_frames(range, listing.files, times.rows);
  frames.warnings = camera_file.warnings;
  add_note(frames, times.note);
  if (!has_times) {
    const double rate_hz = rate_of(camera_file, request, frames);
    for (std::size_t i = 0; i < frames.timestamps_s.size(); ++i) {
      frames.timestamps_s[i] = static_cast<double>(range.begin + i) / rate_hz;
    }
  }
  if (const auto& truth = request.ground_truth ? request.ground_truth : listing.ground_truth) {
    STEMVO_TRY(add_ground_truth(frames, *truth, camera_path, request.ground_truth_tolerance_s,
                                listing.files.size(), true));
  }
  if (!listing.warning.empty()) {
    frames.warnings.push_back(listing.warning);
  }
  STEMVO_TRY_GET(const auto kind,
                 check_images(frames, listing.folder, *camera_path, camera_file.camera));
  STEMVO_TRY_GET(const auto view, view_of(camera_file.camera, *camera_path));
  frames.kind = listing.kind;
  frames.name = listing.name;
  frames.given_calibration = camera_path;
  frames.camera_height_m = camera_file.camera_height_m;
  frames.camera_from_imu = camera_file.camera_from_imu();
  STEMVO_TRY(add_view(frames, view, request.masks, [files = frames.files, kind](std::size_t i) {
    return io::read_image(files[i], kind.is_color, kind.size, kind.levels);
  }));
  return frames;
}

}  // namespace stemvo::dataset
