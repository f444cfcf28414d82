// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "stem/channel.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// A track seen in a frame.
struct Observation {
  int track_id = -1;
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();  ///< input pixels, freed of PixelMap::lens
};
/// All of one frame, ordered by track id.
using Observations = std::vector<Observation>;

/// Correspondences of two frames, in input pixels as Observation has them.
struct Matches {
  std::vector<Eigen::Vector2d> prev_uv;
  std::vector<Eigen::Vector2d> cur_uv;
  std::vector<int> track_ids;  ///< the same id while a point is followed
  int prev_frame = -1;         ///< the number of the frame that prev_uv is on; -1: none
};

/// An image as a front end prepares it, without those before it; each derives what it adds.
struct ImagePyramid {
  explicit ImagePyramid(ChannelImage seen) : channel(std::move(seen)), levels{channel.pixels} {}
  virtual ~ImagePyramid() = default;
  /// The mask for an image of this size whose pixels lie there in the input; empty: everywhere.
  [[nodiscard]] cv::Mat mask_of(const PixelMap& map, cv::Size size) const;

  ChannelImage channel;
  cv::Mat mask;                 ///< where points may be, as FrontEnd::set_mask(); of this image
  std::vector<cv::Mat> levels;  ///< the channel, then each half the size of the one before
};

/// When an image was taken, and what is known of it before it is looked at.
struct ImageClue {
  int frame = 0;        ///< its number, for Matches::prev_frame
  double time_s = 0.0;  ///< images with one time: their intervals are not known
  /// Where the image given before shows what is infinitely far, if it only turned: homogeneous
  /// pixels of the input, cur_from_prev. A hint. nullopt: not known.
  std::optional<Eigen::Matrix3d> turn = std::nullopt;
};

/// Finds correspondences between the last image it was given and the next one. Stateful (it holds
/// the last image); the same images give the same matches, whatever the number of threads.
class FrontEnd {
 public:
  virtual ~FrontEnd() = default;
  /// Where points may be: CV_8UC1 of the input's size, 0 where none; empty: everywhere. Called
  /// before the first image.
  void set_mask(const cv::Mat& mask) { mask_ = mask; }
  /// The part of process() that needs only the image: it may run ahead, in another thread than
  /// the rest, one call at a time. `mask`: as set_mask(), which counts as well; of this image.
  [[nodiscard]] virtual std::shared_ptr<ImagePyramid> prepare(const ChannelImage& channel,
                                                              const cv::Mat& mask) const = 0;
  /// Matches from the previous image (none on the first). An image of another size starts over.
  /// `image` was prepared by this front end (not checked).
  [[nodiscard]] virtual Matches process(std::shared_ptr<const ImagePyramid> image,
                                        const ImageClue& clue) = 0;
  /// Ends the tracks of the last matches that are no inliers (one flag per match).
  virtual void remove_outliers(const std::vector<char>& is_inlier) = 0;
  /// Takes the projections of landmarks into the last image (also outside of it) whose tracks
  /// ended; process() matches them there before it looks for new corners. Called after
  /// remove_outliers(); a track that is not named is forgotten, and one that is not found, unless
  /// something `may_hide` it.
  virtual void expect_projections(Observations /*projections*/,  // NOLINT: an override keeps it
                                  bool /*may_hide*/) {}

 protected:
  /// Both masks.
  [[nodiscard]] cv::Mat with_mask(const cv::Mat& mask) const {
    if (mask_.empty() || mask.empty()) {
      return mask.empty() ? mask_ : mask;
    }
    return (mask_ != 0) & (mask != 0);
  }

 private:
  cv::Mat mask_;
};

[[nodiscard]] std::unique_ptr<FrontEnd> create_front_end(const FeatureOptions& options);
/// One kind, for create_front_end().
[[nodiscard]] std::unique_ptr<FrontEnd> create_patch_front_end(const FeatureOptions& options);
[[nodiscard]] std::unique_ptr<FrontEnd> create_klt_front_end(const FeatureOptions& options);
[[nodiscard]] std::unique_ptr<FrontEnd> create_descriptor_front_end(const FeatureOptions& options);

/// Counts keypoints per cell of an image, so that no part of it takes all of them.
class GridQuota {
 public:
  /// Quota per cell = max_features / cells, at least 1.
  GridQuota(const FeatureOptions& options, cv::Size image_size)
      : columns_(options.grid_columns),
        rows_(options.grid_rows),
        quota_(std::max(1, options.max_features / (columns_ * rows_))),
        size_(image_size),
        counts_(static_cast<std::size_t>(columns_ * rows_), 0) {}

  /// Takes a place in the point's cell; false when the cell is full.
  bool take(const cv::Point2f& image_uv) {
    const auto cell = [](float position, int extent, int num_cells) {
      const int index =
          static_cast<int>(position * static_cast<float>(num_cells) / static_cast<float>(extent));
      return std::clamp(index, 0, num_cells - 1);
    };
    const int column = cell(image_uv.x, size_.width, columns_);
    const int row = cell(image_uv.y, size_.height, rows_);
    int& count = counts_[static_cast<std::size_t>(row * columns_ + column)];
    const bool has_room = count < quota_;
    count += has_room ? 1 : 0;
    return has_room;
  }

 private:
  int columns_;
  int rows_;
  int quota_;
  cv::Size size_;
  std::vector<int> counts_;
};

}  // namespace stemvo
