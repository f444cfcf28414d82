// SPDX-License-Identifier: MIT
#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include <opencv2/video/tracking.hpp>

#include "features/point_front_end.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

constexpr int kBackLevels = 2;
constexpr int kMaxIterations = 15;       ///< per level
constexpr double kConverged_px = 0.015;  ///< an iteration's step, image pixels
/// Windows of 5x5 pixels lose the road: t_rel 0.85 for 0.31 on a rendered drive, whatever their
/// size in the input.
constexpr int kMinReach_px = 3;
/// In a pyramid each level is followed by its derivatives.
constexpr std::size_t kNextLevel = 2;

bool is_inside(const cv::Point2f& uv, cv::Size size) {
  return uv.x >= 0.0F && uv.y >= 0.0F && uv.x <= static_cast<float>(size.width - 1) &&
         uv.y <= static_cast<float>(size.height - 1);
}

/// Tracks by pyramidal Lucas-Kanade (Bouguet 2001) from image to image, there and back.
class KltFrontEnd final : public PointFrontEnd {
 public:
  using PointFrontEnd::PointFrontEnd;

  [[nodiscard]] std::shared_ptr<ImagePyramid> prepare(const ChannelImage& channel,
                                                      const cv::Mat& mask) const override {
    const StageTimer timer(Stage::kPyramid);
    auto image = std::make_shared<KltPyramid>(channel);
    image->mask = with_mask(mask);
    const double scale = channel.map.scale.minCoeff();
    const int half = options().klt_window / 2;
    const int reach = std::max(kMinReach_px, static_cast<int>(half / scale));
    image->window = cv::Size(2 * reach + 1, 2 * reach + 1);
    cv::buildOpticalFlowPyramid(channel.pixels, image->with_derivatives, image->window,
                                num_levels(scale) - 1, /*withDerivatives=*/true);
    for (std::size_t i = kNextLevel; i < image->with_derivatives.size(); i += kNextLevel) {
      image->levels.push_back(image->with_derivatives[i]);
    }
    return image;
  }

 private:
  /// With its pyramid and the derivatives of every level, which both directions use.
  struct KltPyramid : ImagePyramid {
    using ImagePyramid::ImagePyramid;
    [[nodiscard]] int last_level() const { return static_cast<int>(levels.size()) - 1; }
    std::vector<cv::Mat> with_derivatives;
    cv::Size window;
  };

  [[nodiscard]] bool begin_track(const ImagePyramid&, const Point&) override { return true; }
  [[nodiscard]] std::vector<std::optional<cv::Point2f>> track_points(const View& from,
                                                                     View& to) override {
    const auto& prev = static_cast<const KltPyramid&>(*from.image);
    const auto& cur = static_cast<const KltPyramid&>(*to.image);
    std::vector<std::optional<cv::Point2f>> result(from.points.size());
    if (from.points.empty()) {
      return result;
    }
    std::vector<cv::Point2f> prev_uv(from.points.size());
    std::ranges::transform(from.points, prev_uv.begin(), &Point::uv);
    const cv::TermCriteria criteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, kMaxIterations,
                                    kConverged_px);
    std::vector<cv::Point2f> cur_uv;
    std::vector<cv::Point2f> back_uv = prev_uv;
    std::vector<unsigned char> found;
    std::vector<unsigned char> found_back;
    cv::calcOpticalFlowPyrLK(prev.with_derivatives, cur.with_derivatives, prev_uv, cur_uv, found,
                             cv::noArray(), cur.window, cur.last_level(), criteria);
    // The way back starts where the way there started: two levels are enough to leave a wrong
    // place.
    cv::calcOpticalFlowPyrLK(cur.with_derivatives, prev.with_derivatives, cur_uv, back_uv,
                             found_back, cv::noArray(), cur.window,
                             std::min(cur.last_level(), kBackLevels - 1), criteria,
                             cv::OPTFLOW_USE_INITIAL_FLOW);

    for (std::size_t i = 0; i < result.size(); ++i) {
      const cv::Point2f off = prev_uv[i] - back_uv[i];
      const double off_px =
          prev.channel.map.scale.cwiseProduct(Eigen::Vector2d(off.x, off.y)).norm();
      const bool is_good = found[i] != 0 && found_back[i] != 0 &&
                           is_inside(cur_uv[i], cur.channel.pixels.size()) &&
                           off_px <= options().max_forward_backward_px;
      if (is_good) {
        result[i] = cur_uv[i];
      }
    }
    return result;
  }
  void end_other_tracks(const std::vector<Point>&,
                        const std::vector<Point>&,
                        const Observations&) override {}
};

}  // namespace

std::unique_ptr<FrontEnd> create_klt_front_end(const FeatureOptions& options) {
  return std::make_unique<KltFrontEnd>(options);
}

}  // namespace stemvo
