// SPDX-License-Identifier: MIT
#pragma once

#include "mapping/map_file.hpp"

namespace stemvo::testing {

/// A map of two keyframes with two corners each, a motion, a loop and a length.
inline MapFile small_map() {
  MapFile file;
  file.channel = "default";
  KeptKeyframe keyframe;
  keyframe.camera = {100.0, 101.0, 60.0, 45.0, 120, 90};
  keyframe.corners = {{3, {1.5F, 2.5F}, {0.25F, -0.5F, 4.0F}}, {7, {80.0F, 20.0F}}};
  keyframe.descriptors = {{1, 2, 3, 0xffffffffffffffffU}, {}};
  file.map.keyframes.push_back(keyframe);
  keyframe.frame = 5;
  keyframe.time_s = 0.5;
  keyframe.world_from_camera = {Eigen::Quaterniond(0.8, 0.0, 0.6, 0.0), {0.1, -0.2, 1.0 / 3.0}};
  keyframe.descriptors.clear();
  file.map.keyframes.push_back(keyframe);
  const Similarity3 motion(1.25, Eigen::Quaterniond(0.96, 0.28, 0.0, 0.0), {0.1, 0.2, 0.7});
  file.map.map_from_keyframe = {{}, motion};
  file.map.motions = {{0, 1, motion, 1e-3, 2e-3, 3e-3}};
  file.map.loops = {{{0, 1, motion, 1e-2, 2e-2, 3e-2}, {{0, 1}}}};
  file.map.lengths = {{1, 0.7, 0.05}};
  return file;
}

}  // namespace stemvo::testing
