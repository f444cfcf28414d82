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

#include "stemvo/dataset/frame_source.hpp"
#include "stemvo/error.hpp"

/// What all frame sources that read files share.
namespace stemvo::dataset {

[[nodiscard]] bool is_folder(const std::filesystem::path& path);
/// Without a trailing separator, so that its last part is the folder's name.
[[nodiscard]] std::filesystem::path absolute_folder(const std::filesystem::path& folder);

/// Error (folder named): empty or outside the frames there are.
[[nodiscard]] Expected<FrameRange> resolve_range(const std::optional<FrameRangeRequest>& request,
                                                 std::size_t num_frames,
                                                 const std::filesystem::path& folder);

/// False also for NaN.
[[nodiscard]] bool has_center_inside(const Camera& camera);

/// Error (file named): the picture is not of the camera's size.
[[nodiscard]] Status check_size(const std::filesystem::path& file,
                                const cv::Mat& picture,
                                const Camera& camera);

template <typename T>
[[nodiscard]] std::vector<T> cut(const std::vector<T>& all, const FrameRange& range) {
  const auto at = [&](std::size_t i) { return all.begin() + static_cast<std::ptrdiff_t>(i); };
  return {at(range.begin), at(range.end)};
}

/// What most of the first readable pictures are; of equals the one seen first. One odd frame must
/// not throw the rest away. `kind_of`: path -> Expected<Kind>. Error: none can be read.
template <typename Kind, typename KindOf>
[[nodiscard]] Expected<Kind> vote_on_pictures(const std::vector<std::filesystem::path>& files,
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
