// SPDX-License-Identifier: MIT
#include "stemvo/odometry.hpp"

#include <utility>

#include "odometry/answers.hpp"
#include "odometry/check_frame.hpp"
#include "odometry/event_log.hpp"
#include "odometry/phased_odometry.hpp"
#include "odometry/whole_map.hpp"

namespace stemvo {

struct Odometry::Impl {
  [[nodiscard]] Expected<WholeMap> adjusted_map(const std::string& asked,
                                                const std::vector<int>& covariance_of) const {
    return odometry.check_remembers(asked).and_then([&]() -> Expected<WholeMap> {
      WholeMap map = WholeMap(odometry);
      const Status status = map.adjust(covariance_of);
      return status ? Expected<WholeMap>(std::move(map)) : status.error();
    });
  }

  PhasedOdometry odometry;
  FrameCheck check;
  WayInput ways;
  EventLog log = {};
};

Expected<Odometry> Odometry::create(const Camera& camera,
                                    const Options& options,
                                    const cv::Mat& mask) {
  Expected<PhasedOdometry> odometry = PhasedOdometry::create(camera, options, mask);
  if (!odometry) {
    return odometry.error();
  }
  return Odometry(std::make_unique<Impl>(
      Impl{*std::move(odometry), FrameCheck(camera), WayInput(options.scale.source)}));
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
  Frame frame = impl_->odometry.prepare(rgb_of(image, order), time_s, hints);
  frame.ways = impl_->ways.take(time_s);
  FrameResult result = impl_->odometry.process(std::move(frame));
  impl_->log.observe(result);
  return result;
}

Status Odometry::add_speed(double time_s, double metres_per_s, double sigma) {
  return impl_ ? impl_->ways.add_speed(time_s, metres_per_s, sigma) : moved_from();
}

Status Odometry::add_distance(double from_s, double to_s, double metres, double sigma) {
  return impl_ ? impl_->ways.add_distance(from_s, to_s, metres, sigma) : moved_from();
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
    impl_->ways.restart();
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

Expected<AdjustedMap> Odometry::adjust_map(const std::vector<int>& covariance_of) const {
  if (impl_ == nullptr) {
    return moved_from();
  }
  return impl_->adjusted_map("adjust_map", covariance_of).map([](const WholeMap& map) {
    return map.answer();
  });
}

Status Odometry::save_map(const std::filesystem::path& file) const {
  if (impl_ == nullptr) {
    return moved_from();
  }
  return impl_->adjusted_map(file.string(), {}).and_then([&](const WholeMap& map) {
    return impl_->odometry.save_map(file, map);
  });
}

Status Odometry::load_map(const std::filesystem::path& file) {
  return impl_ ? impl_->check.check_none_admitted(file.string()).and_then([&] {
    return impl_->odometry.load_map(file);
  })
               : moved_from();
}

}  // namespace stemvo
