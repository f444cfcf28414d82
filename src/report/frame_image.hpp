// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "evaluation/trajectory.hpp"
#include "features/front_end.hpp"
#include "stem/channel.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// The paper's "optical flow": the input (CV_8UC1 or RGB) above, the channel below at the same
/// width (each may be empty), on both the matches as lines from the previous to the current
/// position: inliers coloured by the length of their flow, outliers thin and red. `inlier_mask`: an
/// entry per match, or empty (all are outliers). CV_8UC3, RGB.
[[nodiscard]] cv::Mat draw_frame_image(const cv::Mat& frame,
                                       const ChannelImage& channel,
                                       const Matches& matches,
                                       const std::vector<char>& inlier_mask);
/// Says what its colours mean; empty where there are no matches.
[[nodiscard]] std::string describe_flow(const Matches& matches,
                                        const std::vector<char>& inlier_mask);
/// It below a band with these texts, which may be empty.
[[nodiscard]] cv::Mat draw_under_caption(const cv::Mat& image,
                                         const std::string& left,
                                         const std::string& right);

/// The paper's Figure 1: a frame and its channels (8 bits, gray or RGB) in a grid, all at the size
/// of the first or smaller, each over its caption (checked).
[[nodiscard]] cv::Mat draw_sheet(const std::vector<cv::Mat>& images,
                                 const std::vector<std::string>& captions);

/// One line of text (ASCII), centred in the height of `box`, `share` of the room left over before
/// it; shrinks until it fits. Returns where the text ends.
int put_caption(cv::Mat& image,
                const cv::Rect& box,
                const std::string& text,
                const cv::Scalar& color,
                double share = 0.0);

/// The bytes of a JPEG at most `width` pixels wide.
[[nodiscard]] std::string encode_jpeg(const cv::Mat& image, int width);

[[nodiscard]] Status write_image(const std::filesystem::path& file, const cv::Mat& image);

/// Top view of a drive: x to the right, z (forward) up, equal axes. Poses are drawn as they
/// are; give both trajectories in the same world (first pose = identity).
struct TrajectoryPlot {
  std::string title;     ///< may be empty
  std::string subtitle;  ///< the numbers, one line; may be empty
  Trajectory estimate;   ///< at least one pose (checked)
  std::optional<Trajectory> ground_truth;
  std::string unit = "m";  ///< in which both axes are
};

/// 1100 to 1600 pixels wide, 780 to 1400 high, after the drive's shape; CV_8UC3, RGB.
[[nodiscard]] cv::Mat draw_trajectory(const TrajectoryPlot& plot);
/// The path alone, at least one pose, in a square of this side, beside a bar that tells its size.
[[nodiscard]] cv::Mat draw_path(const Trajectory& path, int side_px, const std::string& unit);

}  // namespace stemvo
