// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "mapping/kept_map.hpp"

namespace stemvo {

/// Two checks that say the same differ by less: rad, share of the depth and of the way between
/// them.
inline constexpr double kMaxSameTurn_rad = 0.05;
inline constexpr double kMaxSameShift = 0.1;

/// A check of a keyframe against a place that went well.
struct Sighting {
  int lookup = 0;            ///< its number
  double share = 0.0;        ///< of the keyframe's corners that agree
  double common = 0.0;       ///< of the place's landmarks that it should see, those it does
  bool is_by_poses = false;  ///< the map's poses told where to look, or where the one before was
  Loop loop;

  /// Streets that share a house look alike, too, but not all of it.
  [[nodiscard]] bool may_join() const { return std::max(share, common) >= 0.2; }
};

/// The sightings of the last lookups, which confirm each other.
class Sightings {
 public:
  /// Forgets those that are too old for lookup `number`, around which things lie this deep.
  void begin_lookup(int number, double depth);
  void add(Sighting sighting) { sightings_.push_back(std::move(sighting)); }
  [[nodiscard]] const std::vector<Sighting>& all() const { return sightings_; }
  /// The places of another map that say the same in one lookup explain the keyframe, of so many
  /// corners, together: all of these sightings have the share of it.
  void share_what_joins(const KeptMap& map, std::size_t num_corners, Sighting& sighting);
  /// By another sighting, of another place; of keyframes that were looked up before, too, where two
  /// maps are to be joined.
  [[nodiscard]] bool confirm(const KeptMap& map, const Sighting& sighting, bool joins) const;
  /// As PlaceRecognizer::renumber().
  void renumber(std::span<const int> numbers) {
    for (Sighting& sighting : sightings_) {
      sighting.loop.from = numbers[slot(sighting.loop.from)];
      sighting.loop.to = numbers[slot(sighting.loop.to)];
    }
    std::erase_if(sightings_, [](const Sighting& sighting) { return sighting.loop.to < 0; });
  }

 private:
  [[nodiscard]] bool say_the_same(const KeptMap& map, const Sighting& a, const Sighting& b) const;

  std::vector<Sighting> sightings_;
  double depth_ = 0.0;
};

}  // namespace stemvo
