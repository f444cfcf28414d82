// SPDX-License-Identifier: MIT
#include "odometry/channel_odometry.hpp"

#include <utility>

#include "internal_check.hpp"
#include "odometry/pair_estimator.hpp"
#include "odometry/road/image.hpp"
#include "odometry/stopwatch.hpp"
#include "odometry/window_estimator.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

StemOptions stretch_options(const Options& options, const Camera& camera) {
  StemOptions stretch = options.stem;
  stretch.tracking_resolution =
      choose_tracking_resolution(stretch.tracking_resolution, options.features.method, camera);
  return stretch;
}

}  // namespace

ChannelOdometry::ChannelOdometry(const Options& options, const Camera& camera, const cv::Mat& mask)
    : given_camera_(camera),
      asks_road_(options.scale.source == ScaleSource::kCameraHeight),
      stretch_(stretch_options(options, camera)),
      front_end_(create_front_end(options.features)) {
  front_end_->set_mask(mask);
  if (options.odometry.mode == OdometryMode::kTwoFrame) {
    estimator_ = std::make_unique<PairEstimator>(options, camera);
  } else {
    estimator_ = std::make_unique<WindowEstimator>(options, camera);
  }
}

FrameResult ChannelOdometry::process(PreparedFrame frame) {
  track(std::move(frame));
  localize();
  return optimize();
}

PreparedFrame ChannelOdometry::prepare(const Channel& channel, const cv::Mat& frame) {
  PreparedFrame prepared;
  prepared.pixels = frame;
  Stopwatch watch;
  const ChannelImage image = timed(Stage::kStretch, [&] { return stretch_.apply(channel); });
  prepared.stem_ms = watch.lap_ms();
  prepared.image = front_end_->prepare(image);
  if (asks_road_) {
    const StageTimer timer(Stage::kRoadImage);
    prepared.road = std::make_shared<RoadImage>(make_road_image(image, given_camera_));
  }
  return prepared;
}

/// Uses the front end only: the frame before may be optimized meanwhile.
void ChannelOdometry::track(PreparedFrame frame) {
  STEMVO_CHECK(!tracked_.has_value(), "the frame before is localized");
  FrameInWork& work = tracked_.emplace();
  work.tracked.number = num_tracked_++;
  work.image = std::move(frame.image);
  work.problem = std::move(frame.problem);
  if (work.image != nullptr) {
    Stopwatch watch;
    work.tracked.has_image = true;
    work.tracked.matches = front_end_->process(work.image, work.tracked.number);
    work.tracked.image = std::move(frame.pixels);
    work.tracked.road = std::move(frame.road);
    work.times.stem_ms = frame.stem_ms;
    work.times.features_ms = watch.lap_ms();
  }
}

void ChannelOdometry::localize() {
  STEMVO_CHECK(tracked_.has_value(), "a frame was tracked");
  STEMVO_CHECK(!localized_.has_value(), "the frame before is optimized");
  FrameInWork& work = localized_.emplace(*std::exchange(tracked_, std::nullopt));
  Stopwatch watch;
  work.localized = estimator_->localize(work.tracked);
  if (work.tracked.has_image) {
    front_end_->keep(work.localized.inlier_mask);
    front_end_->look_for(std::move(work.localized.lost_landmarks));
    work.times.pose_ms = watch.lap_ms();
  }
}

/// Uses all but the front end.
FrameResult ChannelOdometry::optimize() {
  STEMVO_CHECK(localized_.has_value(), "a frame was localized");
  FrameInWork work = *std::exchange(localized_, std::nullopt);
  Stopwatch watch;
  estimator_->optimize(work.tracked, work.localized);
  if (work.tracked.has_image) {
    work.times.pose_ms += watch.lap_ms();
  } else {  // what is drawn goes on showing the last image there was
    work.image = optimized_.image;
  }
  FrameResult& result = work.localized.result;
  result.times = work.times;
  result.problem = work.problem;
  optimized_ = std::move(work);
  return optimized_.localized.result;
}

const ChannelImage& ChannelOdometry::image() const {
  static const ChannelImage no_image;
  return optimized_.image != nullptr ? optimized_.image->channel : no_image;
}

}  // namespace stemvo
