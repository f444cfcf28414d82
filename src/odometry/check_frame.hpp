// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/odometry.hpp"

namespace stemvo {

/// Errors, starting with `owner`: a size of no pixels or too many, a focal length not above 0, a
/// field of view over 170 degrees, a principal point outside or of images of another size, a number
/// that is not finite.
[[nodiscard]] Status check_camera(const Camera& camera, const std::string& owner = "camera");
/// Says what is odd about a camera that may be right; empty: nothing.
[[nodiscard]] std::string doubt_of(const Camera& camera);

/// Error: a time that is not finite, or not after the last one, which something of this name has.
[[nodiscard]] Status check_time(const std::string& name,
                                double time_s,
                                std::optional<double> last_s,
                                const std::string& of_last);

/// Error: a mask that is neither empty nor CV_8UC1 of the camera's size.
[[nodiscard]] Status check_mask(const cv::Mat& mask, const Camera& camera);

/// The pixels as the odometry takes them; the same ones where they are already.
[[nodiscard]] cv::Mat rgb_of(const cv::Mat& image, PixelOrder order);

/// The rules for a caller's next frame.
class FrameCheck {
 public:
  explicit FrameCheck(const Camera& camera) : camera_(camera) {}

  /// Errors: an image that is not of the camera's size and the order's type; a time that is not
  /// after the last one admitted; a mask as check_mask(); a rotation that is none.
  [[nodiscard]] Status admit(const cv::Mat& image,
                             PixelOrder order,
                             double time_s,
                             const FrameHints& hints);
  /// Error: a frame was admitted. `asked`: what for is the time before.
  [[nodiscard]] Status check_none_admitted(const std::string& asked) const;
  /// The next frame may have any time.
  void restart() { last_time_s_.reset(); }

 private:
  Camera camera_;
  std::optional<double> last_time_s_;
};

}  // namespace stemvo
