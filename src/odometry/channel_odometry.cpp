// SPDX-License-Identifier: MIT
#include "odometry/channel_odometry.hpp"

#include "odometry/pair_estimator.hpp"
#include "odometry/road/image.hpp"
#include "odometry/window_estimator.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// A point that has moved by so much otherwise than expected is still found, pixels of the channel.
constexpr double kUnexpected_px = 4.0;

StemOptions contrast_options(const Options& options, const Camera& camera) {
  StemOptions contrast = options.stem;
  contrast.tracking_resolution =
      choose_tracking_resolution(contrast.tracking_resolution, options.features.method, camera);
  return contrast;
}

}  // namespace

ChannelOdometry::ChannelOdometry(const Options& options, const Camera& camera, const cv::Mat& mask)
    : given_camera_(camera),
      asks_road_(options.scale.source == ScaleSource::kCameraHeight),
      contrast_(contrast_options(options, camera)),
      road_contrast_({.tracking_resolution = TrackingResolution::kNative}),
      front_end_(create_front_end(options.features)),
      image_turn_(camera),
      aligns_images_(options.features.method == FeatureMethod::kPatch) {
  front_end_->set_mask(mask);
  if (options.odometry.mode == OdometryMode::kTwoFrame) {
    estimator_ = std::make_unique<PairEstimator>(options, camera);
  } else {
    estimator_ = std::make_unique<WindowEstimator>(options, camera);
  }
}

Frame ChannelOdometry::prepare(const Channel& channel,
                               const cv::Mat& image,
                               double time_s,
                               const FrameHints& hints) {
  Frame frame;
  frame.time_s = time_s;
  frame.hints = hints;
  if (frame.hints.prev_from_cur) {
    frame.hints.prev_from_cur->normalize();
  }
  frame.image = image;
  Stopwatch watch;
  const ChannelImage seen = timed(Stage::kContrast, [&] { return contrast_.apply(channel); });
  frame.times.stem_ms = watch.lap_ms();
  frame.pyramid = front_end_->prepare(seen, hints.mask);
  if (asks_road_) {
    const StageTimer timer(Stage::kRoadImage);
    const cv::Mat shown =
        shows_texture(image, given_camera_) ? image : cv::Mat::zeros(image.size(), image.type());
    const ChannelImage road = road_contrast_.apply(road_channel(shown, given_camera_));
    frame.road = std::make_shared<RoadImage>(
        make_road_image(road, given_camera_, frame.pyramid->mask_of(road.map, road.pixels.size())));
  }
  return frame;
}

/// Uses the front end only: the frame before may be optimized meanwhile.
void ChannelOdometry::track(Frame frame) {
  frame.given_time_s = frame.time_s;
  frame.time_s = clock_.advance(frame.given_time_s);
  for (Way& way : frame.ways) {
    way.from_s = clock_.since_first(way.from_s);
    way.to_s = clock_.since_first(way.to_s);
  }
  frame.number = num_tracked_++;
  const ImageClue clue = clue_of(frame);
  if (frame.has_image()) {
    Stopwatch watch;
    frame.pyramid->channel.map.lens = lens_;
    frame.matches = front_end_->process(frame.pyramid, clue);
    frame.times.features_ms = watch.lap_ms();
  }
  tracked_ = std::move(frame);
}

/// The whole image says where to look when the camera turns otherwise than it did, or than a hint.
ImageClue ChannelOdometry::clue_of(Frame& frame) {
  const std::optional<Eigen::Quaterniond>& hint = frame.hints.prev_from_cur;
  image_from_tracked_ = image_from_tracked_ && hint
                            ? std::optional<Eigen::Quaterniond>(*image_from_tracked_ * *hint)
                            : std::nullopt;
  ImageClue clue{frame.number, frame.time_s};
  std::optional<Eigen::Quaterniond> turn = image_from_tracked_;
  if (frame.has_image() && aligns_images_) {
    const double interval_s = frame.time_s - std::exchange(last_image_s_, frame.time_s);
    frame.image_turn = image_turn_.align(*frame.pyramid, interval_s, turn);
    const bool is_unexpected =
        frame.image_turn &&
        frame.image_turn->angularDistance(image_turn_.expected()) * given_camera_.mean_focal_px() >
            kUnexpected_px * frame.pyramid->channel.map.scale.mean();
    if (image_turn_.refutes_guess() && (turn || is_unexpected)) {
      turn = frame.image_turn;
    }
  }
  if (turn) {
    const Eigen::Matrix3d k = given_camera_.matrix();
    clue.turn = k * turn->conjugate().toRotationMatrix() * k.inverse();
  }
  if (frame.has_image()) {
    image_from_tracked_ = Eigen::Quaterniond::Identity();
  }
  return clue;
}

void ChannelOdometry::localize() {
  FrameInWork& work = localized_.emplace(FrameInWork{*std::exchange(tracked_, std::nullopt), {}});
  Stopwatch watch;
  work.localized = estimator_->localize(work.frame);
  lens_ = estimator_->lens();
  if (work.frame.has_image()) {
    front_end_->remove_outliers(kept_tracks(work.localized));
    front_end_->expect_projections(std::move(work.localized.projections),
                                   work.localized.may_be_hidden);
    work.frame.times.pose_ms = watch.lap_ms();
  }
}

/// Uses all but the front end.
FrameResult ChannelOdometry::optimize() {
  FrameInWork work = *std::exchange(localized_, std::nullopt);
  Stopwatch watch;
  estimator_->optimize(work.frame, work.localized);
  if (work.frame.has_image()) {
    work.frame.times.pose_ms += watch.lap_ms();
  } else {  // the last image there was stays to be drawn
    work.frame.pyramid = optimized_.frame.pyramid;
  }
  FrameResult& result = work.localized.result;
  result.time_s = times_s_.emplace_back(work.frame.given_time_s);
  result.times = work.frame.times;
  result.problem = work.frame.problem;
  optimized_ = std::move(work);
  return optimized_.localized.result;
}

}  // namespace stemvo
