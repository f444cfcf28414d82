// SPDX-License-Identifier: MIT
#include "stemvo/odometry/odometry.hpp"

#include <utility>

#include "odometry/channel_odometry.hpp"
#include "odometry/stopwatch.hpp"
#include "stemvo/check.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {

struct Odometry::Impl {
  Camera camera;
  Stem stem;
  ChannelOdometry channel_odometry;
};

Expected<Odometry> Odometry::create(const Config& config,
                                    const Camera& camera,
                                    const std::filesystem::path& models_dir) {
  Expected<Stem> stem = Stem::create(config.stem, models_dir);
  if (!stem.has_value()) {
    return stem.error();
  }
  // A model that cannot take this camera's frames is found before work starts.
  const cv::Mat blank(camera.height_px, camera.width_px, CV_8UC1, cv::Scalar(0));
  if (const Expected<Channel> channel = stem->apply(blank); !channel.has_value()) {
    return channel.error();
  }
  Expected<ChannelOdometry> channel_odometry = ChannelOdometry::create(config, camera);
  if (!channel_odometry.has_value()) {
    return channel_odometry.error();
  }
  return Odometry(std::make_unique<Impl>(
      Impl{camera, std::move(stem.value()), std::move(channel_odometry.value())}));
}

Odometry::Odometry(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;
Odometry::~Odometry() = default;

FrameResult Odometry::process(const cv::Mat& frame) {
  track(prepare(frame));
  localize();
  return optimize();
}

FrameResult Odometry::process_missing() { return impl_->channel_odometry.process_missing(); }

PreparedFrame Odometry::prepare(const cv::Mat& frame) {
  STEMVO_CHECK(frame.cols == impl_->camera.width_px && frame.rows == impl_->camera.height_px,
               "the frame has the camera's size");
  Stopwatch watch;
  const Expected<Channel> channel = timed(Stage::kStem, [&] { return impl_->stem.apply(frame); });
  const double stem_ms = watch.lap_ms();
  PreparedFrame prepared;
  if (!channel.has_value()) {
    prepared.problem = channel.error().message;
    return prepared;
  }
  prepared = impl_->channel_odometry.prepare(channel.value(), frame);
  prepared.stem_ms += stem_ms;
  return prepared;
}

void Odometry::track(PreparedFrame frame) { impl_->channel_odometry.track(std::move(frame)); }

void Odometry::localize() { impl_->channel_odometry.localize(); }

FrameResult Odometry::optimize() { return impl_->channel_odometry.optimize(); }

std::vector<Rigid3> Odometry::refined_trajectory() const {
  return impl_->channel_odometry.estimator().refined_trajectory();
}

std::vector<MapLandmark> Odometry::landmarks() const {
  return impl_->channel_odometry.estimator().landmarks();
}

const ChannelImage& Odometry::channel_image() const { return impl_->channel_odometry.image(); }
const Matches& Odometry::matches() const { return impl_->channel_odometry.matches(); }
const std::vector<char>& Odometry::inlier_mask() const {
  return impl_->channel_odometry.inlier_mask();
}
const StemInfo& Odometry::stem_info() const { return impl_->stem.info(); }

}  // namespace stemvo
