// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "stemvo/error.hpp"
#include "stemvo/stem/channel.hpp"

namespace stemvo {

/// Keys `features.*` of the configuration.
struct FeatureOptions {
  std::string method = "klt";  ///< `klt`, `orb` or `sift`
  int max_features = 500;      ///< keypoints aimed at per frame
  int grid_columns = 16;       ///< quota per cell = max_features / (columns * rows)
  int grid_rows = 6;
  double corner_quality = 0.005;          ///< klt: least corner response over the strongest
  double min_distance_px = 8.0;           ///< klt: between keypoints, in input pixels
  int klt_window = 11;                    ///< klt: input pixels, odd; at least 7 of the picture
  int klt_levels = 4;                     ///< klt: of the pyramid over the input's size
  double max_forward_backward_px = 0.25;  ///< klt: input pixels
  int fast_threshold = 10;                ///< orb
  double ratio = 0.8;                     ///< sift: best over second-best descriptor distance
};

/// Correspondences of two frames, in input pixels.
struct Matches {
  std::vector<Eigen::Vector2d> prev_uv;
  std::vector<Eigen::Vector2d> cur_uv;
  std::vector<int> track_ids;  ///< the same id while a point is followed
  int prev_frame = -1;         ///< the number of the frame that prev_uv is on; -1: none
  int num_keypoints = 0;       ///< found or asked for, before matching
};

/// What a front end makes of a picture on its own, without those before it.
struct PreparedPicture {
  explicit PreparedPicture(ChannelImage channel_image) : image(std::move(channel_image)) {}
  virtual ~PreparedPicture() = default;
  ChannelImage image;
};

/// Finds correspondences between the last picture it was given and the next one. Stateful (it holds
/// the last picture); the same pictures give the same matches, whatever the number of threads.
class FrontEnd {
 public:
  virtual ~FrontEnd() = default;
  /// The part of process() that needs only the picture: it may run ahead, in another thread than
  /// the rest, one call at a time.
  [[nodiscard]] virtual std::shared_ptr<const PreparedPicture> prepare(
      const ChannelImage& image) const = 0;
  /// Matches from the previous picture (none on the first). A picture of another size starts over.
  /// `picture` was prepared by this front end.
  /// `frame` is the picture's number for Matches::prev_frame.
  [[nodiscard]] virtual Matches process(std::shared_ptr<const PreparedPicture> picture,
                                        int frame) = 0;
  [[nodiscard]] Matches process(const ChannelImage& image, int frame = 0) {
    return process(prepare(image), frame);
  }
  /// Drops the tracks of the last matches that are not good (one flag per match), so that they are
  /// not followed further.
  virtual void keep(const std::vector<char>& is_good) = 0;
};

/// Error: unknown method (lists the known ones).
[[nodiscard]] Expected<std::unique_ptr<FrontEnd>> create_front_end(const FeatureOptions& options);

}  // namespace stemvo
