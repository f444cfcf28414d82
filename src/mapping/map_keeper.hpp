// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "mapping/kept_map.hpp"
#include "odometry/window.hpp"
#include "odometry/window_history.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// The estimator's state as the map sees it.
struct WindowView {
  const Window& window;
  const WindowHistory& history;  ///< of its units
  const Camera& camera;
  std::span<const Eigen::Vector2d> radials;  ///< of the RadialLens that frames were freed of
  std::span<const Rigid3> trajectory;        ///< of the frames that have ended
  std::span<const double> times_s;
  std::optional<double> metric_sigma;  ///< of log(metres per unit); nullopt: units are no metres
  int last_localized = -1;             ///< the last frame that landmarks placed
};

/// The corners of a keyframe of the window, with the landmarks as they are now.
[[nodiscard]] std::vector<KeptCorner> corners_of(const WindowView& view, const Keyframe& keyframe);

/// Fills the kept map from the window: a keyframe becomes a node once its pose is in the
/// trajectory; its landmarks, and the motions to its neighbours, are kept as they are when it
/// leaves. A window that begins where the one before ended goes on in its map, in a unit of its
/// own. Nodes that nothing measured connects are maps of their own, until a loop joins them: the
/// younger one is moved to the older.
class MapKeeper {
 public:
  /// Before the first node: what another recording left, whose frames and times come to lie before
  /// this one's.
  void load(KeptMap map);

  /// Makes nodes of the window's keyframes that are none yet, but for those whose frame is in work.
  void add_nodes(const WindowView& view) {
    for (const Keyframe& keyframe : view.window.keyframes) {
      if (node_of(keyframe.frame) < 0 &&
          keyframe.frame < static_cast<int>(view.trajectory.size())) {
        add_node(view, keyframe);
      }
    }
  }
  /// A keyframe is about to leave the window.
  void leave(const WindowView& view, std::size_t leaving);
  /// The whole window is about to be dropped; the next one is a new map.
  void close(const WindowView& view) {
    last_localized_ = view.last_localized;
    add_nodes(view);
    for (std::size_t i = 0; i < view.window.keyframes.size(); ++i) {
      leave(view, i);
    }
  }
  /// The next window belongs to the map of this loop's `from`; its first keyframe is the loop's
  /// `to`.
  void begin_at(const Loop& relocation) { relocation_ = relocation; }

  /// Returns how the window moves, new world from old, where its map is joined to an older one.
  [[nodiscard]] std::optional<Similarity3> add_loop(const Loop& loop);
  /// The graph alone, without corners, but with the motions inside the window.
  [[nodiscard]] KeptMap graph(const WindowView& view) const;
  /// The first nodes' map_from_keyframe as it became in the graph; the others go with the last.
  void apply(std::span<const Similarity3> solved);

  /// Merges what shows kept places only. Returns the new number of each node, -1 for those that are
  /// none any more; empty: none has changed.
  [[nodiscard]] std::vector<int> merge();

  [[nodiscard]] const KeptMap& map() const { return map_; }
  /// The keeper ends.
  [[nodiscard]] KeptMap take_map() { return std::move(map_); }
  [[nodiscard]] KeptKeyframe& keyframe(int node) { return map_.keyframes[slot(node)]; }
  /// The node of a keyframe of the window; -1: it is none yet.
  [[nodiscard]] int node_of(int frame) const {
    const auto node = nodes_.find(frame);
    return node == nodes_.end() ? -1 : node->second;
  }

  /// The correction so far.
  [[nodiscard]] const Similarity3& map_from_world() const { return map_from_world_; }
  /// Nothing of this recording is in the map yet: the map comes to the world, and not the world to
  /// the map.
  void correct(const Similarity3& map_from_world) { map_from_world_ = map_from_world; }
  /// A map holds keyframes of this recording.
  [[nodiscard]] bool has_own(int component) const {
    for (std::size_t i = 0; i < components_.size(); ++i) {
      if (components_[i] == component && map_.keyframes[i].frame >= 0) {
        return true;
      }
    }
    return false;
  }
  /// The window's map is young, and another one is older.
  [[nodiscard]] bool may_soon_be_joined() const {
    constexpr std::ptrdiff_t kYoung = 30;
    return !components_.empty() && component_ != components_.front() &&
           std::ranges::count(components_, component_) < kYoung;
  }
  [[nodiscard]] std::span<const int> components() const { return components_; }
  [[nodiscard]] int component_of(int node) const { return components_[slot(node)]; }

 private:
  void add_node(const WindowView& view, const Keyframe& keyframe);
  void connect_first(KeptKeyframe& kept);
  void reopen_last(const Keyframe& keyframe);
  void find_components();

  KeptMap map_;
  std::vector<int> components_;  ///< of each node the map that it belongs to, the older the lower
  Similarity3 map_from_world_;
  std::map<int, int> nodes_;  ///< of the window's keyframes, by frame
  int last_localized_ = -1;   ///< in the window before
  int component_ = -1;        ///< the window's
  int num_components_ = 0;    ///< so far
  std::optional<Loop> relocation_;
};

}  // namespace stemvo
