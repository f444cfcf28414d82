// SPDX-License-Identifier: MIT
#include <algorithm>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include <opencv2/features2d.hpp>

#include "features/front_end.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// Detectors are asked for more than the quota so that every cell can choose its strongest.
constexpr int kOversampling = 4;

cv::Ptr<cv::Feature2D> create_feature(const FeatureOptions& options) {
  const int num_asked = kOversampling * options.max_features;
  if (options.method == FeatureMethod::kOrb) {
    return cv::ORB::create(num_asked, 1.2F, 8, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31,
                           options.fast_threshold);
  }
  return cv::SIFT::create(num_asked);
}

/// Detect, describe, match by brute force: the paper's way (ORB) and the classic one (SIFT).
class DescriptorFrontEnd final : public FrontEnd {
 public:
  explicit DescriptorFrontEnd(const FeatureOptions& options)
      : options_(options), feature_(create_feature(options)) {}

  [[nodiscard]] std::shared_ptr<ImagePyramid> prepare(const ChannelImage& channel,
                                                      const cv::Mat& mask) const override {
    auto described = std::make_shared<Described>(channel);
    described->mask = with_mask(mask);
    std::vector<cv::KeyPoint> found;
    timed(Stage::kDetection, [&] {
      feature_->detect(channel.pixels, found,
                       described->mask_of(channel.map, channel.pixels.size()));
    });
    // Strongest first; ties by place, so that the order never depends on the detector's threads.
    std::ranges::sort(found, {}, [](const cv::KeyPoint& point) {
      return std::tuple(-point.response, point.pt.y, point.pt.x);
    });
    GridQuota quota(options_, channel.pixels.size());
    std::vector<cv::KeyPoint> kept;
    for (const cv::KeyPoint& keypoint : found) {
      if (quota.take(keypoint.pt)) {
        kept.push_back(keypoint);
      }
    }
    if (kept.empty()) {
      return described;
    }
    timed(Stage::kDescription,
          [&] { feature_->compute(channel.pixels, kept, described->descriptors); });
    for (const cv::KeyPoint& keypoint : kept) {
      described->uv.emplace_back(keypoint.pt.x, keypoint.pt.y);
    }
    return described;
  }

  [[nodiscard]] Matches process(std::shared_ptr<const ImagePyramid> prepared,
                                const ImageClue& clue) override {
    auto current = std::static_pointer_cast<const Described>(std::move(prepared));
    Matches matches;
    std::vector<int> track_ids(current->uv.size(), -1);
    matched_.clear();
    if (last_ != nullptr && last_->channel.pixels.size() == current->channel.pixels.size()) {
      for (const cv::DMatch& pair : match(*last_, *current)) {
        const auto from = static_cast<std::size_t>(pair.queryIdx);
        const auto to = static_cast<std::size_t>(pair.trainIdx);
        matches.prev_uv.push_back(last_->channel.map.to_input(last_->uv[from]));
        matches.cur_uv.push_back(current->channel.map.to_input(current->uv[to]));
        track_ids[to] = track_ids_[from] >= 0 ? track_ids_[from] : num_tracks_++;
        matches.track_ids.push_back(track_ids[to]);
        matched_.push_back(to);
      }
    }
    matches.prev_frame = std::exchange(last_frame_, clue.frame);
    last_ = std::move(current);
    track_ids_ = std::move(track_ids);
    return matches;
  }

  void remove_outliers(const std::vector<char>& is_inlier) override {
    for (std::size_t i = 0; i < std::min(is_inlier.size(), matched_.size()); ++i) {
      if (is_inlier[i] == 0) {
        track_ids_[matched_[i]] = -1;
      }
    }
  }

 private:
  struct Described : ImagePyramid {
    using ImagePyramid::ImagePyramid;
    std::vector<Eigen::Vector2d> uv;  ///< pixels of the channel
    cv::Mat descriptors;              ///< one row per keypoint
  };

  [[nodiscard]] std::vector<cv::DMatch> match(const Described& prev, const Described& cur) const {
    const StageTimer timer(Stage::kTracking);
    if (prev.descriptors.empty() || cur.descriptors.empty()) {
      return {};
    }
    if (options_.method == FeatureMethod::kOrb) {
      std::vector<cv::DMatch> pairs;
      cv::BFMatcher(cv::NORM_HAMMING, /*crossCheck=*/true)
          .match(prev.descriptors, cur.descriptors, pairs);
      return pairs;
    }
    std::vector<std::vector<cv::DMatch>> best_two;
    cv::BFMatcher(cv::NORM_L2).knnMatch(prev.descriptors, cur.descriptors, best_two, 2);
    std::vector<cv::DMatch> pairs;
    for (const std::vector<cv::DMatch>& candidates : best_two) {
      if (candidates.size() == 2 &&
          candidates[0].distance < options_.ratio * static_cast<double>(candidates[1].distance)) {
        pairs.push_back(candidates[0]);
      }
    }
    return pairs;
  }

  FeatureOptions options_;
  cv::Ptr<cv::Feature2D> feature_;
  std::shared_ptr<const Described> last_;
  int last_frame_ = -1;
  std::vector<int> track_ids_;        ///< of last_'s keypoints; -1: not matched with those before
  std::vector<std::size_t> matched_;  ///< keypoints of last_ that the last matches led to
  int num_tracks_ = 0;
};

}  // namespace

std::unique_ptr<FrontEnd> create_descriptor_front_end(const FeatureOptions& options) {
  return std::make_unique<DescriptorFrontEnd>(options);
}

}  // namespace stemvo
