// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

#include "mapping/kept_map.hpp"
#include "mapping/map_keeper.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Remembers what leaves the window (`odometry.loops`; off: nothing).
class Mapper {
 public:
  explicit Mapper(const Options& options) : is_on_(options.odometry.loops) {}

  /// The window has a new keyframe; those before it have all their corners now.
  void observe(const WindowView& view);
  /// A keyframe is about to leave the window.
  void leave(const WindowView& view, std::size_t leaving);
  /// The whole window is about to be dropped.
  void close(const WindowView& view);

  /// The correction so far.
  [[nodiscard]] const Similarity3& map_from_world() const { return keeper_.map_from_world(); }
  /// With the keyframes that are still in the window.
  [[nodiscard]] KeptMap map(const WindowView& view) const;

 private:
  bool is_on_;
  MapKeeper keeper_;
};

}  // namespace stemvo
