// SPDX-License-Identifier: MIT
#include "stemvo/odometry.hpp"

#include <utility>

#include "odometry/answers.hpp"
#include "odometry/check_frame.hpp"
#include "odometry/event_log.hpp"
#include "odometry/phased_odometry.hpp"

namespace stemvo {

struct Odometry::Impl {
  PhasedOdometry odometry;
  FrameCheck check;
  EventLog log = {};
};

Expected<Odometry> Odometry::create(const Camera& camera,
                                    const Options& options,
                                    const cv::Mat& mask) {
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
  if (impl_ == nullptr) {
    return moved_from();
  }
  if (Status status = impl_->check.admit(image, order, time_s, hints); !status) {
    return status.error();
  }
  PhasedOdometry& odometry = impl_->odometry;
  FrameResult result = odometry.process(odometry.prepare(rgb_of(image, order), time_s, hints));
  impl_->log.observe(result);
  return result;
}

void Odometry::set_log(Log log) {
  if (impl_ != nullptr) {
    impl_->log.set(std::move(log));
  }
}

void Odometry::reset() {
  if (impl_ != nullptr) {
    impl_->odometry.reset();
    impl_->check.restart();
    impl_->log.restart();
  }
}

MapChanges Odometry::landmarks_since(int version) const {
  return impl_ ? stemvo::landmarks_since(impl_->odometry.frames(), version) : MapChanges();
}
std::vector<MapKeyframe> Odometry::keyframes(int first) const {
  return impl_ ? keyframes_of(impl_->odometry.frames(), first) : std::vector<MapKeyframe>();
}
std::vector<TrackedPoint> Odometry::tracked_points() const {
  return impl_ ? tracked_points_of(impl_->odometry.frames()) : std::vector<TrackedPoint>();
}
cv::Mat Odometry::channel_image() const {
  return impl_ ? impl_->odometry.frames().image().pixels : cv::Mat();
}

}  // namespace stemvo
