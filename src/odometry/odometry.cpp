// SPDX-License-Identifier: MIT
#include "stemvo/odometry.hpp"

#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "odometry/check_camera.hpp"
#include "odometry/phased_odometry.hpp"

namespace stemvo {
namespace {

Status check_image(const cv::Mat& image, PixelOrder order, const cv::Size& size) {
  if (image.size() != size) {
    return fail(fmt::format("image: expected {}x{} pixels, as the camera has, found {}x{}",
                            size.width, size.height, image.cols, image.rows));
  }
  const int channels = order == PixelOrder::kGray ? 1 : 3;
  if (image.type() != CV_MAKETYPE(CV_8U, channels)) {
    return fail(fmt::format("image: expected {} channel{} of 8 bit, found OpenCV's type {}",
                            channels, channels == 1 ? "" : "s", cv::typeToString(image.type())));
  }
  return {};
}

Status check_mask(const cv::Mat& mask, const Camera& camera) {
  const cv::Size size(camera.width_px, camera.height_px);
  if (!mask.empty() && (mask.size() != size || mask.type() != CV_8UC1)) {
    return fail(fmt::format("mask: expected {}x{} pixels of CV_8UC1, found {}x{} of {}", size.width,
                            size.height, mask.cols, mask.rows, cv::typeToString(mask.type())));
  }
  return {};
}

}  // namespace

struct Odometry::Impl {
  PhasedOdometry odometry;
};

Expected<Odometry> Odometry::create(const Camera& camera,
                                    const Options& options,
                                    const cv::Mat& mask) {
  Status status = check_camera(camera);
  status = status ? validate(options) : status;
  status = status ? check_mask(mask, camera) : status;
  if (!status) {
    return status.error();
  }
  Expected<PhasedOdometry> odometry = PhasedOdometry::create(camera, options, mask);
  if (!odometry) {
    return odometry.error();
  }
  return Odometry(std::make_unique<Impl>(Impl{*std::move(odometry)}));
}

Odometry::Odometry(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;
Odometry::~Odometry() = default;

Expected<FrameResult> Odometry::process(const cv::Mat& image, PixelOrder order) {
  const cv::Size size = impl_->odometry.view().full_size();
  if (Status status = check_image(image, order, size); !status) {
    return status.error();
  }
  if (order != PixelOrder::kBgr) {
    return impl_->odometry.process(impl_->odometry.prepare(image));
  }
  cv::Mat rgb;  // of its own: the caller's pixels are not ours
  cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
  return impl_->odometry.process(impl_->odometry.prepare(rgb));
}

FrameResult Odometry::process_missing() { return impl_->odometry.process({}); }

std::vector<MapLandmark> Odometry::landmarks() const {
  const Estimator& estimator = impl_->odometry.frames().estimator();
  std::vector<MapLandmark> landmarks;
  for (const KeptLandmark& kept : estimator.landmarks()) {
    const Rigid3& world_from_camera = estimator.trajectory()[static_cast<std::size_t>(kept.frame)];
    landmarks.push_back({world_from_camera * kept.in_camera.cast<double>(), kept.rgb});
  }
  return landmarks;
}

std::vector<TrackedPoint> Odometry::tracked_points() const {
  const Matches& matches = impl_->odometry.frames().matches();
  const std::vector<char>& is_inlier = impl_->odometry.frames().inlier_mask();
  std::vector<TrackedPoint> points;
  for (std::size_t i = 0; i < matches.track_ids.size(); ++i) {
    points.push_back({matches.track_ids[i], matches.prev_uv[i], matches.cur_uv[i],
                      i < is_inlier.size() && is_inlier[i] != 0});
  }
  return points;
}

cv::Mat Odometry::channel_image() const { return impl_->odometry.frames().image().pixels; }

}  // namespace stemvo
