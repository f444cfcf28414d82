// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core.hpp>

#include "dataset/frame_source.hpp"
#include "io/image_file.hpp"
#include "stemvo/error.hpp"

/// What all frame sources that read files share.
namespace stemvo::dataset {

[[nodiscard]] bool is_folder(const std::filesystem::path& path);
/// Without a trailing separator, so that its last part is the folder's name.
[[nodiscard]] std::filesystem::path absolute_folder(const std::filesystem::path& folder);
/// What lies in a folder, in no order. Error: it cannot be listed.
[[nodiscard]] Expected<std::vector<std::filesystem::path>> list_folder(
    const std::filesystem::path& folder);

/// All where nothing is asked for. Error: empty or outside the `count` frames (or what `things`
/// are) of `owner`.
[[nodiscard]] Expected<FrameRange> resolve_range(const std::optional<FrameRangeRequest>& request,
                                                 std::size_t count,
                                                 const std::string& owner,
                                                 std::string_view things = "frames");

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
/// not throw the rest away. `kind_of`: of a file. Error: none can be read.
[[nodiscard]] Expected<io::ImageKind> vote_on_images(
    const std::vector<std::filesystem::path>& files,
    const std::function<Expected<io::ImageKind>(const std::filesystem::path&)>& kind_of);

}  // namespace stemvo::dataset
