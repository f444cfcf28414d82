// SPDX-License-Identifier: MIT
#pragma once

// The same of an odometry's state.

#include <cmath>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include <cereal/types/array.hpp>
#include <cereal/types/deque.hpp>
#include <cereal/types/memory.hpp>
#include <cereal/types/optional.hpp>
#include <cereal/types/string.hpp>

#include "features/state_archive.hpp"
#include "odometry/bundle_adjustment.hpp"
#include "odometry/initializer.hpp"
#include "odometry/road/image.hpp"
#include "odometry/window_history.hpp"
#include "stem/stem.hpp"
#include "stemvo/frame_result.hpp"

namespace cereal {

// What says why something was not done: the same few constants again and again.

template <typename Archive>
void save(Archive& archive, const std::string_view& reason) {
  archive(std::string(reason));
}

template <typename Archive>
void load(Archive& archive, std::string_view& reason) {
  static std::set<std::string> known;  // kept: views of them are
  std::string text;
  archive(text);
  reason = *known.insert(std::move(text)).first;
}

}  // namespace cereal

namespace stemvo {

template <typename Archive>
void serialize(Archive& archive, Rigid3& pose) {
  archive(pose.rotation, pose.translation);
}
template <typename Archive>
void serialize(Archive& archive, Camera& camera) {
  serialize_bytes(archive, camera);
  constexpr double kLargest_px = 1e9;
  const auto is_size = [](int side) { return side > 0 && side <= kMaxImageSide_px; };
  const auto is_focal = [](double f_px) { return f_px > 1e-9 && f_px < kLargest_px; };
  StateReader::expect_of<Archive>(is_focal(camera.fx_px) && is_focal(camera.fy_px) &&
                                  std::abs(camera.cx_px) < kLargest_px &&
                                  std::abs(camera.cy_px) < kLargest_px &&
                                  is_size(camera.width_px) && is_size(camera.height_px));
}
template <typename Archive>
void serialize(Archive& archive, CameraMeasurement& measured) {
  archive(measured.change, measured.information);
}
template <typename Archive>
void serialize(Archive& archive, RoadImage::Level& level) {
  archive(level.camera, level.first_row, level.values);
}
template <typename Archive>
void serialize(Archive& archive, RoadImage& road) {
  archive(road.pixels, road.map, road.full);
  const auto& [camera, first_row, values] = road.full;
  const cv::Size below(road.pixels.cols, road.pixels.rows - first_row);
  StateReader::expect_of<Archive>(
      !road.pixels.empty() && road.pixels.type() == CV_8UC1 && first_row >= 0 &&
      camera.width_px == road.pixels.cols && camera.height_px == road.pixels.rows &&
      (values.empty() || (values.type() == CV_32FC4 && values.size() == below)));
}
template <typename Archive>
void serialize(Archive& archive, View& view) {
  archive(view.frame, view.world_from_camera, view.points, view.road);
  expect_ordered<Archive>(view.points, &TrackPoint::track_id);
}
template <typename Archive>
void serialize(Archive& archive, FrameBetween& frame) {
  archive(frame.frame, frame.keyframe_from_camera);
}
template <typename Archive>
void serialize(Archive& archive, Keyframe& keyframe) {
  archive(keyframe.frame, keyframe.world_from_camera, keyframe.points, keyframe.followers);
  expect_ordered<Archive>(keyframe.points, &TrackPoint::track_id);
}
template <typename Archive>
void serialize(Archive& archive, Window& window) {
  archive(window.keyframes, window.landmarks);
  int last = -1;  // frames are counted once, in order
  for (const Keyframe& keyframe : window.keyframes) {
    StateReader::expect_of<Archive>(keyframe.frame > last);
    last = keyframe.frame;
    for (const FrameBetween& follower : keyframe.followers) {
      StateReader::expect_of<Archive>(follower.frame > last);
      last = follower.frame;
    }
  }
}
template <typename Archive>
void serialize(Archive& archive, WindowMotion& motion) {
  archive(motion.prev, motion.cur, motion.prev_from_cur);
}
template <typename Archive>
void serialize(Archive& archive, MapLandmark& landmark) {
  archive(landmark.frame, landmark.position, landmark.rgb);
}
template <typename Archive>
void serialize(Archive& archive, CameraSigma& sigma) {
  serialize_bytes(archive, sigma);
}
template <typename Archive>
void serialize(Archive& archive, StageTimes& times) {
  serialize_bytes(archive, times);
}
template <typename Archive>
void serialize(Archive& archive, ChannelStretch::Limits& limits) {
  archive(limits.are_known, limits.low, limits.high);
}
template <typename Archive>
void serialize(Archive& archive, FrameResult& result) {
  archive(result.state, result.world_from_camera, result.num_matches, result.num_inliers,
          result.homography_score, result.fundamental_score, result.homography_ratio, result.model,
          result.road, result.road_reason, result.camera, result.camera_sigma, result.scale_sigma,
          result.times, result.problem);
  StateReader::expect(result.state >= FrameState::kFirst && result.state <= FrameState::kNoImage &&
                      result.road >= RoadState::kDisabled && result.road <= RoadState::kMeasured &&
                      result.model >= TwoViewModel::kNone &&
                      result.model <= TwoViewModel::kEssential);
}

}  // namespace stemvo
