// SPDX-License-Identifier: MIT
#include "dataset/listing.hpp"

#include <cctype>

#include <fmt/format.h>
#include <fnmatch.h>

#include "dataset/frame_files.hpp"
#include "dataset/image_names.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace fs = std::filesystem;

namespace {

std::optional<fs::path> if_exists(const fs::path& file) {
  return is_there(file) ? std::optional(file) : std::nullopt;
}

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
  return read_list(camera / "data.csv", kNanosecond_s,
                   {.kind = "EuRoC recording",
                    .folder = camera / "data",
                    .name = recording_name(mav),
                    .camera_file = camera / "sensor.yaml",
                    .ground_truth = if_exists(mav / "state_groundtruth_estimate0/data.csv")});
}

Expected<Listing> list_tum(const fs::path& folder) {
  return read_list(folder / "rgb.txt", 1.0,
                   {.kind = "TUM RGB-D recording",
                    .folder = folder,
                    .name = recording_name(folder),
                    .camera_file = if_exists(folder / "camera.yaml"),
                    .ground_truth = if_exists(folder / "groundtruth.txt")});
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

/// "_left" of "left_*.png"; nothing of "*.png", which is all of a folder.
std::string name_part(const std::string& pattern) {
  std::string part = fs::path(pattern).stem().string();
  std::erase_if(part, [](unsigned char c) { return std::isalnum(c) == 0 && c != '_' && c != '-'; });
  part = part.substr(0, part.find_last_not_of("_-") + 1);
  return part.empty() ? "" : (part.find_first_of("_-") == 0 ? "" : "_") + part;
}

bool has_image_name(const fs::path& file) {
  return fnmatch("[!.]*.@(png|jpg|jpeg)", file.filename().c_str(), FNM_EXTMATCH | FNM_CASEFOLD) ==
         0;
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

bool matches_pattern(const std::string& name, const std::string& pattern) {
  return fnmatch(pattern.c_str(), name.c_str(), 0) == 0;
}

bool is_image_file(const fs::path& file) { return has_image_name(file) && is_file(file); }

bool is_pattern(const fs::path& path) {
  return path.string().find_first_of("*?[") != std::string::npos && !is_there(path);
}

Expected<Listing> list_images(const fs::path& given) {
  Listing result{.kind = "images", .folder = given, .name = {}, .files = {}};
  std::string pattern = "*";
  if (is_pattern(given)) {
    result.folder = given.has_parent_path() ? given.parent_path() : fs::path(".");
    pattern = given.filename().string();
  }
  if (is_pattern(result.folder)) {
    return fail(fmt::format("{}: expected *, ? and [..] in the last part only, found them in '{}'",
                            given.string(), result.folder.string()));
  }
  if (!is_folder(result.folder)) {
    return fail(
        fmt::format("{}: expected a folder of images or a pattern with *, ? or [..], found none",
                    result.folder.string()));
  }
  STEMVO_TRY_GET(const auto found, list_folder(result.folder));
  for (const fs::path& file : found) {
    if (has_image_name(file) && matches_pattern(file.filename().string(), pattern) &&
        !is_folder(file)) {
      result.files.push_back(file);
    }
  }
  if (result.files.empty()) {
    return fail(fmt::format("{}: expected images (.png, .jpg, .jpeg), found none; check the path",
                            given.string()));
  }
  sort_images(result.files);
  if (const Status single = check_image_names(result.files, given); !single) {
    if (pattern == "*") {
      return single.error();
    }
    result.warning = single.error().message;  // who gave a pattern may mean both
  }
  result.warning = result.warning.empty() ? warn_of_names(result.files) : result.warning;
  result.name = recording_name(result.folder) + name_part(pattern);
  return result;
}

}  // namespace stemvo::dataset
