// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <map>
#include <span>

#include "mapping/kept_map.hpp"
#include "odometry/window.hpp"
#include "odometry/window_history.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// What the estimator shows of itself.
struct WindowView {
  const Window& window;
  const WindowHistory& history;  ///< of its units
  const Camera& camera;
  std::span<const Rigid3> trajectory;  ///< of the frames that have ended
  std::span<const double> times_s;
};

/// Fills the kept map from the window: a keyframe becomes a node once its pose is in the
/// trajectory; its landmarks, and the motions to its neighbours, are kept as they are when it
/// leaves.
class MapKeeper {
 public:
  /// Makes nodes of the window's keyframes that are none yet, but for those whose frame is in work.
  void add_nodes(const WindowView& view);
  /// A keyframe is about to leave the window.
  void leave(const WindowView& view, std::size_t leaving);
  /// The whole window is about to be dropped; the next one is a new map.
  void close(const WindowView& view);

  [[nodiscard]] const KeptMap& map() const { return map_; }
  [[nodiscard]] KeptMap& map() { return map_; }
  /// Of a keyframe of the window; -1: it is none yet.
  [[nodiscard]] int node_of(int frame) const;

  /// The correction so far.
  [[nodiscard]] const Similarity3& map_from_world() const { return map_from_world_; }
  void correct(const Similarity3& map_from_world) { map_from_world_ = map_from_world; }

 private:
  void add_node(const WindowView& view, const Keyframe& keyframe);
  void keep(const WindowView& view, std::size_t leaving);

  KeptMap map_;
  Similarity3 map_from_world_;
  std::map<int, int> nodes_;  ///< of the window's keyframes, by frame
};

}  // namespace stemvo
