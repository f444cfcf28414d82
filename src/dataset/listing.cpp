// SPDX-License-Identifier: MIT
#include "dataset/listing.hpp"

#include <system_error>

#include "dataset/frame_files.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace {

namespace fs = std::filesystem;

bool is_there(const fs::path& file) {
  std::error_code code;
  return fs::exists(file, code);
}

std::optional<fs::path> if_exists(const fs::path& file) {
  return is_there(file) ? std::optional(file) : std::nullopt;
}

/// The listing with the images that a list names, and their times.
Expected<Listing> read_list(const fs::path& list, double unit_s, Listing listing) {
  STEMVO_TRY_GET(auto found, read_timed_rows(list, {2}, "a time and an image's name", {}, unit_s));
  listing.note = std::move(found.note);
  for (const TimedRow& row : found.rows) {
    listing.times_s.push_back(row.time_s);
    listing.files.push_back(listing.folder / split_words(row.rest).front());
  }
  return listing;
}

/// The folder with data.csv of the camera, if it is EuRoC's; one of the two files may be missing
/// where the folder's name says what it is.
std::optional<fs::path> find_euroc_camera(const fs::path& folder) {
  const auto has = [&](const fs::path& inside, const char* file) {
    return is_there(folder / inside / file);
  };
  for (const char* inside : {"mav0/cam0", "cam0"}) {
    if (has(inside, "data.csv") || has(inside, "sensor.yaml")) {
      return absolute_folder(folder / inside);
    }
  }
  return has("", "data.csv") && has("", "sensor.yaml") ? std::optional(absolute_folder(folder))
                                                       : std::nullopt;
}

Expected<Listing> list_euroc(const fs::path& camera) {
  const fs::path mav = camera.parent_path();
  Listing listing;
  listing.kind = "EuRoC recording";
  listing.folder = camera / "data";
  listing.name = recording_name(mav);
  listing.camera_file = camera / "sensor.yaml";
  listing.ground_truth = if_exists(mav / "state_groundtruth_estimate0/data.csv");
  return read_list(camera / "data.csv", kNanosecond_s, std::move(listing));
}

Expected<Listing> list_tum(const fs::path& folder) {
  Listing listing;
  listing.kind = "TUM RGB-D recording";
  listing.folder = folder;
  listing.name = recording_name(folder);
  listing.camera_file = if_exists(folder / "camera.yaml");
  listing.ground_truth = if_exists(folder / "groundtruth.txt");
  return read_list(folder / "rgb.txt", 1.0, std::move(listing));
}

Expected<Listing> list_own(const fs::path& folder) {
  const fs::path images = is_folder(folder / "images") ? folder / "images" : folder;
  Expected<Listing> listing = list_images(images);
  if (listing) {
    listing->name = recording_name(folder);
    listing->camera_file = folder / "camera.yaml";
    listing->times_file = if_exists(folder / "times.txt");
    listing->ground_truth = if_exists(folder / "poses.txt");
  }
  return listing;
}

}  // namespace

std::optional<Expected<Listing>> find_listing(const fs::path& folder) {
  if (const auto camera = find_euroc_camera(folder)) {
    return list_euroc(*camera);
  }
  if (is_there(folder / "rgb.txt")) {
    return list_tum(folder);
  }
  // A folder in KITTI's layout stays one beside a camera.yaml for its images alone.
  const bool is_ours = is_there(folder / "camera.yaml") && !is_there(folder / "calib.txt");
  return is_ours ? std::optional(list_own(folder)) : std::nullopt;
}

}  // namespace stemvo::dataset
