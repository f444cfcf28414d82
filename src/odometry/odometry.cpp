// SPDX-License-Identifier: MIT
#include "stemvo/odometry.hpp"

#include <utility>

#include <opencv2/imgproc.hpp>

#include "odometry/check_camera.hpp"
#include "odometry/check_frame.hpp"
#include "odometry/phased_odometry.hpp"

namespace stemvo {

struct Odometry::Impl {
  PhasedOdometry odometry;
  FrameCheck check;
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
  return Odometry(std::make_unique<Impl>(Impl{*std::move(odometry), FrameCheck(camera)}));
}

Odometry::Odometry(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;
Odometry::~Odometry() = default;

Expected<FrameResult> Odometry::process(const cv::Mat& image,
                                        PixelOrder order,
                                        double time_s,
                                        const FrameHints& hints) {
  if (Status status = impl_->check.admit(image, order, time_s, hints); !status) {
    return status.error();
  }
  cv::Mat seen = image;
  if (order == PixelOrder::kBgr) {
    seen = cv::Mat();  // of its own: the caller's pixels are not ours
    cv::cvtColor(image, seen, cv::COLOR_BGR2RGB);
  }
  return impl_->odometry.process(impl_->odometry.prepare(seen, time_s, hints));
}

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
