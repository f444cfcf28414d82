// SPDX-License-Identifier: MIT
#include "robustness/disturbance.hpp"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace stemvo::robustness {

const std::vector<Disturbance>& disturbances() {
  static const std::vector<Disturbance> kAll = [] {
    std::vector<Disturbance> all = effects();
    std::ranges::copy(resamplings(), std::back_inserter(all));
    return all;
  }();
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
  FrameSource frames = source;
  frames.read = [read = frames.read, disturbance, strength, seed, size = source.size(),
                 camera = source.camera](std::size_t frame) {
    Expected<cv::Mat> image = read(frame);
    if (image && disturbance.disturbs(frame, size, strength)) {
      disturbance.apply(*image, strength, {frame, seed, camera});
    }
    return image;
  };
  return frames;
}

}  // namespace stemvo::robustness
