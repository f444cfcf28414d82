// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include <opencv2/core.hpp>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "features/front_end.hpp"
#include "odometry/estimator.hpp"
#include "odometry/window_estimator.hpp"
#include "stem/stem.hpp"

namespace stemvo::bench {

/// Drive that the stages are measured on: the first frames of $STEMVO_BENCH_SEQUENCE, a KITTI
/// folder, or of a drive rendered for this run, at KITTI's size.
struct Frames {
  std::filesystem::path folder;  ///< room for files, removed at the end
  FrameSource sequence;
  std::vector<cv::Mat> pixels;
  bool is_color = false;
};
[[nodiscard]] const Frames& frames();

/// The defaults, taken through the frames up to the last one, stage by stage.
struct Chain {
  Config config;
  Camera camera;
  Channel channel;                             ///< of the last frame
  std::vector<ChannelImage> images;            ///< of all frames
  Frame last;                                  ///< the last frame
  Matches matches;                             ///< to the last frame
  std::unique_ptr<WindowEstimator> estimator;  ///< after the frame before
};
[[nodiscard]] const Chain& chain();

/// A model by name or path with the defaults; throws with the library's message.
[[nodiscard]] Stem load_stem(const StemOptions& options);

}  // namespace stemvo::bench
