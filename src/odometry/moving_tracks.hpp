// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "features/front_end.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Tracks of things that move on their own: neither landmarks nor voters. They are followed, so
/// that no new corner of the same thing takes their place each frame.
class MovingTracks {
 public:
  explicit MovingTracks(const Options& config) : options_(config.two_view), seed_(config.seed) {}

  void clear() { evidence_.clear(); }
  /// `moving_mask`, one per match: these move as a thing does.
  void begin(const Matches& matches, const std::vector<char>& moving_mask);
  /// A localized frame: tracks join that move as the things do, those leave that move as the world
  /// does. `fits_world`: one per match.
  void observe(const Matches& matches, const std::vector<char>& fits_world);

  [[nodiscard]] bool empty() const { return evidence_.empty(); }
  /// One per match.
  [[nodiscard]] std::vector<char> flags(const Matches& matches) const;
  /// Clears their flags in a mask, one per match.
  void leave_out(const Matches& matches, std::vector<char>& mask) const;

 private:
  TwoViewOptions options_;
  std::uint64_t seed_;
  std::map<int, int> evidence_;  ///< by track id: frames for a thing less those for the world
};

}  // namespace stemvo
