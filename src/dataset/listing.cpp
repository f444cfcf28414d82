// SPDX-License-Identifier: MIT
#include "dataset/listing.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "dataset/image_list.hpp"
#include "text/text_file.hpp"

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

/// Rows `time name` of a list, `#` before comments; times increase. `unit_s`: of the times.
Status read_list(const fs::path& list, const fs::path& folder, double unit_s, Listing& listing) {
  const auto lines = read_lines(list);
  if (!lines) {
    return lines.error();
  }
  for (std::size_t i = 0; i < lines->size(); ++i) {
    std::string line = (*lines)[i];
    std::replace(line.begin(), line.end(), ',', ' ');
    const std::vector<std::string_view> words = split_words(line);
    if (words.empty() || words.front().starts_with('#')) {
      continue;
    }
    if (words.size() != 2) {
      return fail_at(
          list, i,
          fail(fmt::format("expected a time and an image's name, found {} words", words.size())));
    }
    const auto time = parse_numbers(words[0], 1);
    if (!time) {
      return fail_at(list, i, time.error());
    }
    const double time_s = unit_s * time->front();
    if (!listing.times_s.empty() && !(time_s > listing.times_s.back())) {
      return fail_at(
          list, i,
          fail(fmt::format("expected a time after that of the image before, found {}", words[0])));
    }
    listing.times_s.push_back(time_s);
    listing.files.push_back(folder / words[1]);
  }
  if (listing.files.empty()) {
    return fail(fmt::format("{}: expected at least one image, found none", list.string()));
  }
  return {};
}

/// The folder with data.csv of the camera, if it is EuRoC's.
std::optional<fs::path> find_euroc_camera(const fs::path& folder) {
  for (const char* inside : {"mav0/cam0", "cam0", ""}) {
    const fs::path camera = *inside == '\0' ? folder : folder / inside;
    if (is_there(camera / "data.csv") && is_there(camera / "sensor.yaml")) {
      return camera;
    }
  }
  return std::nullopt;
}

Expected<Listing> list_euroc(const fs::path& folder) {
  constexpr double kNanosecond_s = 1e-9;
  const fs::path camera = absolute_folder(*find_euroc_camera(folder));
  const fs::path mav = camera.parent_path();
  Listing listing;
  listing.kind = "EuRoC recording";
  listing.folder = camera / "data";
  listing.name = (mav.filename() == "mav0" ? mav.parent_path() : mav).filename().string();
  listing.camera_file = camera / "sensor.yaml";
  listing.ground_truth = if_exists(mav / "state_groundtruth_estimate0/data.csv");
  const Status status = read_list(camera / "data.csv", listing.folder, kNanosecond_s, listing);
  return status ? Expected<Listing>(std::move(listing)) : status.error();
}

Expected<Listing> list_tum(const fs::path& folder) {
  Listing listing;
  listing.kind = "TUM RGB-D recording";
  listing.folder = folder;
  listing.name = absolute_folder(folder).filename().string();
  listing.camera_file = if_exists(folder / "camera.yaml");
  listing.ground_truth = if_exists(folder / "groundtruth.txt");
  const Status status = read_list(folder / "rgb.txt", folder, 1.0, listing);
  return status ? Expected<Listing>(std::move(listing)) : status.error();
}

Expected<Listing> list_own(const fs::path& folder) {
  const fs::path images = is_folder(folder / "images") ? folder / "images" : folder;
  Expected<Listing> listing = list_plain_images(images);
  if (listing) {
    listing->name = absolute_folder(folder).filename().string();
    listing->camera_file = folder / "camera.yaml";
    listing->times_file = if_exists(folder / "times.txt");
    listing->ground_truth = if_exists(folder / "poses.txt");
  }
  return listing;
}

}  // namespace

Layout euroc_layout() {
  return {[](const fs::path& folder) { return find_euroc_camera(folder).has_value(); }, list_euroc};
}

Layout tum_layout() {
  return {[](const fs::path& folder) { return is_there(folder / "rgb.txt"); }, list_tum};
}

Layout own_layout() {
  // A rendered walk is KITTI's layout with a camera.yaml for those who read its images alone.
  const auto is_own = [](const fs::path& folder) {
    return is_there(folder / "camera.yaml") && !is_there(folder / "calib.txt");
  };
  return {is_own, list_own};
}

Expected<Listing> list_plain_images(const fs::path& folder_or_pattern) {
  return list_images(folder_or_pattern).map([](const ImageList& images) {
    Listing listing;
    listing.kind = "images";
    listing.folder = images.folder;
    listing.name = absolute_folder(images.folder).filename().string();
    listing.files = images.files;
    return listing;
  });
}

}  // namespace stemvo::dataset
