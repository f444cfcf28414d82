// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <vector>

#include <opencv2/core.hpp>

#include "features/front_end.hpp"

namespace stemvo {

/// Corners followed by pyramidal Lucas-Kanade (Bouguet 2001), there and back; cells that lost
/// points are refilled with new corners.
class KltFrontEnd : public FrontEnd {
 public:
  explicit KltFrontEnd(const FeatureOptions& options) : options_(options) {}

  using FrontEnd::process;
  [[nodiscard]] std::shared_ptr<const PreparedPicture> prepare(
      const ChannelImage& image) const override;
  [[nodiscard]] Matches process(std::shared_ptr<const PreparedPicture> picture, int frame) override;
  void keep(const std::vector<char>& is_good) override;

 private:
  /// A point of the last picture, in that picture's pixels.
  struct Point {
    cv::Point2f uv;
    int id = -1;
  };

  /// With its pyramid and the derivatives of every level, which both directions use.
  struct Picture;

  /// An image and its points.
  struct View {
    std::shared_ptr<const Picture> picture;
    std::vector<Point> points;
    int frame = -1;
  };

  [[nodiscard]] Matches track(const View& from, View& to) const;
  void track_from_last_good(View& now, Matches& matches);
  [[nodiscard]] static bool is_lost(const Matches& matches, const View& from);
  void replenish(View& view);

  FeatureOptions options_;
  View last_;
  View last_good_;  ///< the one before nearly every track ended; none otherwise
  int next_id_ = 0;
};

}  // namespace stemvo
