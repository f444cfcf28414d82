// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "features/point_front_end.hpp"

namespace stemvo {

/// Tracks by pyramidal Lucas-Kanade (Bouguet 2001) from image to image, there and back.
class KltFrontEnd final : public PointFrontEnd {
 public:
  explicit KltFrontEnd(const FeatureOptions& options) : PointFrontEnd(options) {}

  [[nodiscard]] std::shared_ptr<const ImagePyramid> prepare(const ChannelImage& channel,
                                                            const cv::Mat& mask) const override;

 private:
  /// With its pyramid and the derivatives of every level, which both directions use.
  struct KltPyramid;

  [[nodiscard]] bool begin_track(const ImagePyramid&, const Point&) override { return true; }
  [[nodiscard]] std::vector<std::optional<cv::Point2f>> track_points(const View& from,
                                                                     View& to) override;
  void end_other_tracks(const std::vector<Point>&,
                        const std::vector<Point>&,
                        const Observations&) override {}
};

}  // namespace stemvo
