// SPDX-License-Identifier: MIT
#include "robustness/disturbance.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace stemvo::robustness {

const std::vector<Disturbance>& disturbances() {
  namespace fx = effects;
  namespace rs = resampling;
  static const std::vector<Disturbance> kAll = {
      {"exposure_steps",
       "light",
       "gain jumps every 12 frames, up to this factor",
       {1.2, 1.5, 2.0},
       fx::exposure_steps},
      {"exposure_drift",
       "light",
       "gain swings slowly up to this factor",
       {1.5, 2.0, 3.0},
       fx::exposure_drift},
      {"gamma", "light", "gray levels to this power", {1.5, 2.2, 3.0}, fx::gamma},
      {"vignette",
       "light",
       "this share of the light is lost in the corners",
       {0.3, 0.6, 0.9},
       fx::vignette},
      {"dusk",
       "noise",
       "the light falls to this share in 50 frames, photon and read noise; gain makes up for half "
       "of the stops",
       {0.1, 0.03, 0.01},
       fx::dusk},
      {"low_contrast",
       "light",
       "this share of the contrast is left",
       {0.5, 0.25, 0.1},
       fx::low_contrast},
      {"sensor_noise",
       "noise",
       "normal noise of this many gray levels",
       {6.0, 12.0, 24.0},
       fx::sensor_noise},
      {"gaussian_blur",
       "blur",
       "of this sigma, pixels of a frame 1242 wide",
       {1.0, 2.0, 3.0},
       fx::gaussian_blur},
      {"motion_blur",
       "blur",
       "along a line so long, of another direction in each frame",
       {5.0, 11.0, 21.0},
       fx::motion_blur},
      {"jpeg", "noise", "compressed at this quality", {30.0, 15.0, 7.0}, fx::jpeg},
      {"fog",
       "weather",
       "visible so far, metres, on a flat road between walls 40 m away",
       {100.0, 50.0, 25.0},
       fx::fog},
      {"rain",
       "weather",
       "so many streaks per frame of 1242x375",
       {200.0, 600.0, 1500.0},
       fx::rain},
      {"shadows",
       "light",
       "bands that move over the image take this share of the light",
       {0.3, 0.5, 0.7},
       fx::shadows},
      {"dirt",
       "in the way",
       "blots on the lens over this share of the image",
       {0.05, 0.1, 0.2},
       fx::dirt},
      {"occluder",
       "in the way",
       "something passes before the camera, of this share of the image",
       {0.1, 0.2, 0.4},
       fx::occluder,
       nullptr,
       fx::occluder_passes},
      {"moving_third",
       "in the way",
       "a third of the image moves on its own, pixels per frame",
       {2.0, 5.0, 10.0},
       fx::moving_third},
      {"blackout",
       "in the way",
       "no light in so many of 100 frames",
       {3.0, 10.0, 20.0},
       fx::blackout,
       nullptr,
       fx::is_black},
      {"dropped",
       "other frames",
       "this share of the frames is missing",
       {0.05, 0.1, 0.2},
       nullptr,
       rs::dropped},
      {"repeated",
       "other frames",
       "this share of the frames shows the one before",
       {0.05, 0.1, 0.2},
       nullptr,
       rs::repeated},
      {"every_nth",
       "other frames",
       "only every so many frames",
       {2.0, 3.0, 5.0},
       nullptr,
       rs::every_nth},
      {"cropped",
       "other views",
       "only the middle of the image, this share of its sides",
       {0.8, 0.6, 0.4},
       nullptr,
       rs::cropped},
      {"scaled",
       "other views",
       "the image made smaller by this factor",
       {0.75, 0.5, 0.35},
       nullptr,
       rs::scaled},
  };
  return kAll;
}

const Disturbance* find_disturbance(std::string_view name) {
  const auto found = std::ranges::find(disturbances(), name, &Disturbance::name);
  return found == disturbances().end() ? nullptr : &*found;
}

std::string names_of_disturbances() {
  std::vector<std::string_view> names;
  for (const Disturbance& one : disturbances()) {
    names.push_back(one.name);
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

std::size_t num_calm_frames(std::size_t num_frames) {
  return std::min<std::size_t>(30, num_frames / 8);
}

bool Disturbance::disturbs(std::size_t frame, std::size_t num_frames, double strength) const {
  return apply == nullptr || (frame + num_calm_frames(num_frames) < num_frames &&
                              (is_on == nullptr || is_on(frame, strength)));
}

FrameSource disturb(const FrameSource& source,
                    const Disturbance& disturbance,
                    std::size_t index,
                    std::uint64_t seed) {
  const double strength = disturbance.strengths.at(index);
  if (disturbance.resample != nullptr) {
    return disturbance.resample(source, strength, seed);
  }
  FrameList frames = source.frames();
  frames.read = [read = frames.read, disturbance, strength, seed, size = source.size(),
                 camera = source.camera()](std::size_t frame) {
    Expected<cv::Mat> image = read(frame);
    if (image && disturbance.disturbs(frame, size, strength)) {
      disturbance.apply(*image, strength, {frame, seed, camera});
    }
    return image;
  };
  return FrameSource(std::move(frames));
}

}  // namespace stemvo::robustness
