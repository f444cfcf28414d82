// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "dataset/frame_source.hpp"
#include "stemvo/error.hpp"

/// What all frame sources that read files share.
namespace stemvo::dataset {

[[nodiscard]] bool is_folder(const std::filesystem::path& path);
/// Without a trailing separator, so that its last part is the folder's name.
[[nodiscard]] std::filesystem::path absolute_folder(const std::filesystem::path& folder);
/// What lies in a folder, in no order. Error: it cannot be listed.
[[nodiscard]] Expected<std::vector<std::filesystem::path>> list_folder(
    const std::filesystem::path& folder);

/// Error (folder named): empty or outside the frames there are.
[[nodiscard]] Expected<FrameRange> resolve_range(const std::optional<FrameRangeRequest>& request,
                                                 std::size_t num_frames,
                                                 const std::filesystem::path& folder);

/// Files, times and, where there is a file of them, poses (KITTI's format) of the range; the rest
/// of the list is left as it is made. The file has at least the poses up to the range's end;
/// `is_exact`: as many as there are files. Errors: those of read_kitti_trajectory; another number
/// of poses.
[[nodiscard]] Expected<FrameList> list_frames(const FrameRange& range,
                                              const std::vector<std::filesystem::path>& files,
                                              const std::vector<double>& times_s,
                                              const std::optional<std::filesystem::path>& poses,
                                              bool is_exact);

/// Error: the principal point is outside the image, or not a number.
[[nodiscard]] Status check_center(const Camera& camera);

/// The image as it is. Error: its own, or (file named) it is not of the camera's size.
[[nodiscard]] Expected<cv::Mat> check_size(const std::filesystem::path& file,
                                           Expected<cv::Mat> image,
                                           const Camera& camera);

/// Images of a folder beside a camera file, which is given (open_source).
[[nodiscard]] Expected<FrameSource> open_image_folder(const FrameSourceRequest& request);

/// What most of the first readable images are; of equals the one seen first. One odd frame must
/// not throw the rest away. `kind_of`: path -> Expected<Kind>. Error: none can be read.
template <typename Kind, typename KindOf>
[[nodiscard]] Expected<Kind> vote_on_images(const std::vector<std::filesystem::path>& files,
                                            const KindOf& kind_of) {
  constexpr std::size_t kNumVotes = 5;
  std::string first_message;
  std::vector<Kind> votes;
  for (auto file = files.begin(); file != files.end() && votes.size() < kNumVotes; ++file) {
    const Expected<Kind> kind = kind_of(*file);
    if (kind) {
      votes.push_back(*kind);
    } else if (first_message.empty()) {
      first_message = kind.error().message;
    }
  }
  if (votes.empty()) {
    return fail(
        fmt::format("none of {} images can be read; the first: {}", files.size(), first_message));
  }
  return *std::max_element(votes.begin(), votes.end(), [&](const Kind& a, const Kind& b) {
    return std::count(votes.begin(), votes.end(), a) < std::count(votes.begin(), votes.end(), b);
  });
}

}  // namespace stemvo::dataset
