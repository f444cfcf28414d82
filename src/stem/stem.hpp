// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "stem/channel.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Facts about the loaded model.
struct StemInfo {
  std::string model = {};  ///< as asked for
  std::string layer = {};  ///< empty for one made by hand
  int filter = 0;          ///< the one chosen, never -1
  int num_filters = 1;
  int sampling_px = 1;
  bool takes_any_size = true;  ///< else frames of one size, or one channel pixel for each stride
};

namespace internal {

/// Filters over a frame: the channels of filters [first, last).
using FilterBank =
    std::function<Expected<std::vector<Channel>>(const cv::Mat& frame, int first, int last)>;

}  // namespace internal

/// Whether it names channels without a network, to compare a learned one with.
[[nodiscard]] bool is_hand_made(const std::string& model);

/// Filters of a layer of a network: frame in, channels out. Const and gives the same bytes whatever
/// the number of threads. Frames are CV_8UC3 in RGB order, or CV_8UC1
/// (replicated to three planes). Errors of all: the frame is smaller than the kernel, or the
/// runtime refused it.
class Stem {
 public:
  /// Loads and checks a model, for `apply` alone: of the default one the default filter's own file.
  /// Errors: no such model, not ONNX, no metadata that say kernel, stride and padding, or others
  /// than the graph's, inputs or outputs other than 1x3xHxW or 1x1xHxW -> 1xCxhxw float, filter
  /// outside [0, C), sampling_px not a divisor of the stride.
  /// `num_threads`: of OpenCV's, that may work on a frame at a time; 0: all it has.
  [[nodiscard]] static Expected<Stem> load(const StemOptions& options,
                                           int num_threads = 0,
                                           bool all_filters = false);
  /// The same with all filters, for `apply_all` and `apply_range` too.
  [[nodiscard]] static Expected<Stem> load_all(const StemOptions& options) {
    return load(options, 0, /*all_filters=*/true);
  }

  [[nodiscard]] const StemInfo& info() const { return info_; }
  /// How many times larger (bicubic) the frame is made for the filters: 2 or 1.
  [[nodiscard]] int frame_zoom(TrackingResolution resolution) const {
    const bool is_asked = resolution == TrackingResolution::kInputZoomed && info_.takes_any_size;
    return is_asked && info_.sampling_px % 2 == 0 ? 2 : 1;
  }
  /// The one filter chosen.
  [[nodiscard]] Expected<Channel> apply(const cv::Mat& frame, int zoom = 1) const;
  /// All filters of the layer from one pass, in order. Of a stem made by load_all, as
  /// apply_range.
  [[nodiscard]] Expected<std::vector<Channel>> apply_all(const cv::Mat& frame) const {
    return apply_range(frame, 0, info_.num_filters);
  }
  /// Filters [first, last) of the layer from one pass: no more memory than theirs.
  /// 0 <= first < last <= info().num_filters.
  [[nodiscard]] Expected<std::vector<Channel>> apply_range(const cv::Mat& frame,
                                                           int first,
                                                           int last,
                                                           int zoom = 1) const;

 private:
  Stem(StemInfo info, internal::FilterBank bank, bool has_all)
      : info_(std::move(info)), bank_(std::move(bank)), has_all_(has_all) {}

  StemInfo info_;
  internal::FilterBank bank_;
  bool has_all_;  ///< else `bank_` is the one chosen, in a file of its own
};

/// Resolves kAuto: for tracked points kHalf where half the size still has many pixels per
/// degree (a focal length of 500 px and more in the input), else kInputZoomed; for others kInput.
[[nodiscard]] TrackingResolution choose_tracking_resolution(TrackingResolution asked,
                                                            FeatureMethod method,
                                                            const Camera& camera);

/// Float channel -> 8-bit image: percentile limits that change slowly along the drive, so that a
/// patch keeps its gray value from frame to frame; then bicubic upsampling by the whole factor that
/// brings it to the input's size, or half of it, or half its size where it is twice as fine: 4x4
/// pixels weighted 1 3 3 1 along x and y (a mean of 2x2 is aliased; PixelMap is adjusted). A
/// channel without contrast becomes one gray and leaves the limits as they were; NaN becomes 0
/// (upsampled: its surroundings too).
class ContrastNormalization {
 public:
  /// In `options.tracking_resolution`, kAuto and kInputZoomed stand for
  /// kInput: see choose_tracking_resolution.
  explicit ContrastNormalization(const StemOptions& options) : options_(options) {}
  [[nodiscard]] ChannelImage apply(const Channel& channel);

 private:
  struct Limits {
    bool are_known = false;
    double low = 0.0;
    double high = 1.0;
  };

  /// A patch keeps its gray value where the light changes at once. False: the frames do not tell.
  bool follow_light(const cv::Mat& values);

  StemOptions options_;
  Limits limits_;         ///< of the channels before
  cv::Mat light_values_;  ///< of the channel before
  cv::Mat smooth_;        ///< buffer
  cv::Mat resized_;       ///< buffer
};

}  // namespace stemvo
