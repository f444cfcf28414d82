// SPDX-License-Identifier: MIT
#include "stemvo/odometry/odometry.hpp"

#include <chrono>
#include <optional>
#include <utility>

#include "odometry/map_history.hpp"
#include "odometry/map_odometry.hpp"
#include "odometry/motion_chain.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/check.hpp"

namespace stemvo {
namespace {

/// Milliseconds since construction or the last call.
class Stopwatch {
 public:
  double lap_ms() {
    const auto now = std::chrono::steady_clock::now();
    const double elapsed = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
    return elapsed;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace

struct Odometry::Impl {
  Impl(const Config& config,
       const Camera& camera_in,
       Stem stem_in,
       std::unique_ptr<FrontEnd> front_end_in)
      : camera(camera_in),
        seed(config.seed),
        stem(std::move(stem_in)),
        stretch(config.stem),
        front_end(std::move(front_end_in)),
        estimator(config, camera_in),
        chain(config.odometry, config.scale) {
    if (config.odometry.mode == "map" || config.scale.source == "camera_height") {
      map.emplace(config, camera_in);
    }
  }

  Camera camera;
  std::uint64_t seed;
  Stem stem;
  ChannelStretch stretch;
  std::unique_ptr<FrontEnd> front_end;
  TwoViewEstimator estimator;
  MotionChain chain;
  std::optional<MapOdometry> map;

  void add_road(FrameResult& result) const {
    if (map.has_value()) {
      result.road = map->road_state();
      result.road_reason = map->road_reason();
      result.scale_sigma = map->scale_sigma();
    }
  }

  /// Of the frame being processed.
  [[nodiscard]] int frame_number() const { return static_cast<int>(poses.size()); }

  ChannelImage image;
  Matches matches;
  MeasuredMotion motion;
  std::vector<Rigid3> poses;  ///< of all frames, as they came
};

Expected<Odometry> Odometry::create(const Config& config,
                                    const Camera& camera,
                                    const std::filesystem::path& models_dir) {
  Expected<Stem> stem = Stem::create(config.stem, models_dir);
  if (!stem.has_value()) {
    return tl::unexpected<Error>(stem.error());
  }
  // A model that cannot take this camera's frames is found before work starts.
  const cv::Mat blank(camera.height_px, camera.width_px, CV_8UC1, cv::Scalar(0));
  if (const Expected<Channel> channel = stem->apply(blank); !channel.has_value()) {
    return tl::unexpected<Error>(channel.error());
  }
  Expected<std::unique_ptr<FrontEnd>> front_end = create_front_end(config.features);
  if (!front_end.has_value()) {
    return tl::unexpected<Error>(front_end.error());
  }
  return Odometry(std::make_unique<Impl>(config, camera, std::move(stem.value()),
                                         std::move(front_end.value())));
}

Odometry::Odometry(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;
Odometry::~Odometry() = default;

FrameResult Odometry::process(const cv::Mat& frame) {
  FrameResult result = process_picture(frame);
  impl_->poses.push_back(result.world_from_camera);
  return result;
}

FrameResult Odometry::process_picture(const cv::Mat& frame) {
  STEMVO_CHECK(frame.cols == impl_->camera.width_px && frame.rows == impl_->camera.height_px,
               "the frame has the camera's size");
  Impl& self = *impl_;
  FrameResult result;
  Stopwatch watch;

  const Expected<Channel> channel = self.stem.apply(frame);
  if (!channel.has_value()) {
    result = skip_frame();
    result.problem = channel.error().message;
    return result;
  }
  self.image = self.stretch.apply(channel.value());
  result.times.stem_ms = watch.lap_ms();

  self.matches = self.front_end->process(self.image);
  result.times.features_ms = watch.lap_ms();

  if (!self.chain.has_picture()) {
    self.chain.start();
    if (self.map.has_value()) {
      self.map->restart(self.frame_number(), self.image);
    }
    self.add_road(result);
    result.world_from_camera = self.chain.world_from_camera();
    return result;
  }
  self.motion = self.estimator.measure(self.matches.prev_uv, self.matches.cur_uv,
                                       self.chain.is_initializing(), self.seed);
  if (self.map.has_value()) {
    self.motion = self.map->refine(self.frame_number(), self.image, self.matches,
                                   self.chain.world_from_picture(), std::move(self.motion));
    self.map->look(frame);
  }
  self.front_end->keep(self.motion.inlier_mask);
  result.state = self.chain.add(self.motion);
  result.times.pose_ms = watch.lap_ms();

  result.world_from_camera = self.chain.world_from_camera();
  result.num_matches = static_cast<int>(self.matches.cur_uv.size());
  result.num_inliers = self.motion.num_inliers;
  result.homography_score = self.motion.homography_score;
  result.fundamental_score = self.motion.fundamental_score;
  result.homography_ratio = self.motion.homography_ratio;
  result.model = self.motion.model;
  self.add_road(result);
  return result;
}

FrameResult Odometry::process_missing() {
  FrameResult result = skip_frame();
  impl_->poses.push_back(result.world_from_camera);
  return result;
}

FrameResult Odometry::skip_frame() {
  impl_->chain.extrapolate(/*has_picture=*/false);
  impl_->matches = {};
  impl_->motion = {};
  FrameResult result;
  result.state = FrameState::kBroken;
  result.world_from_camera = impl_->chain.world_from_camera();
  impl_->add_road(result);
  if (result.road == RoadState::kMeasured) {
    result.road = RoadState::kHeld;
  }
  if (result.road != RoadState::kNotAsked) {
    result.road_reason = "no picture";
  }
  return result;
}

void Odometry::keep_landmarks() {
  if (impl_->map.has_value()) {
    impl_->map->keep_landmarks();
  }
}

std::vector<MapLandmark> Odometry::landmarks() const {
  return impl_->map.has_value() ? impl_->map->history().landmarks() : std::vector<MapLandmark>();
}

std::vector<Rigid3> Odometry::refined_trajectory() const {
  return impl_->map.has_value() ? refined_poses(impl_->poses, impl_->map->history().motions())
                                : impl_->poses;
}

const ChannelImage& Odometry::channel_image() const { return impl_->image; }
const Matches& Odometry::matches() const { return impl_->matches; }
const std::vector<char>& Odometry::inlier_mask() const { return impl_->motion.inlier_mask; }
const StemInfo& Odometry::stem_info() const { return impl_->stem.info(); }

}  // namespace stemvo
