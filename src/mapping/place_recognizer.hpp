// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "mapping/kept_map.hpp"
#include "mapping/place_check.hpp"
#include "mapping/place_index.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A lost frame, found.
struct LocatedFrame {
  int keyframe = 0;             ///< the old one's number in the map
  Rigid3 keyframe_from_camera;  ///< in the old one's unit
  /// A track of the frame, and its landmark in the old keyframe's camera.
  std::vector<std::pair<int, Eigen::Vector3d>> landmarks;
};

/// Tells which keyframe shows a kept place. A check of one pair may be wrong where things repeat: a
/// place counts once another pair, of a neighbouring place or keyframe, says the same.
///
/// For each keyframe that is complete: asks(); if so describe() its corners, recognize(), and
/// unless it shows a kept place add(). The same answers on every run.
class PlaceRecognizer {
 public:
  /// Whether the keyframe is worth a lookup: it shows enough that the last one looked up did not.
  [[nodiscard]] bool asks(const KeptKeyframe& keyframe) const;

  /// The keyframe, which has landmarks as they are now and a descriptor per corner, is to be the
  /// map's keyframe `number`. Reads of the map keyframes far before it alone, and where they are.
  /// The loop's corners are those of both keyframes as they are given here.
  [[nodiscard]] std::optional<Loop> recognize(const KeptMap& map,
                                              int number,
                                              const KeptKeyframe& keyframe);
  /// The last one that was looked up shows a place that is kept: it needs not become one.
  [[nodiscard]] bool shows_kept_place() const { return shows_kept_place_; }
  /// It becomes a place: its descriptors and corners must stay in the map.
  void add(int number, const KeptKeyframe& keyframe);

  /// Looks a frame without a pose up; its corners need no landmarks. Frames come in their order.
  [[nodiscard]] std::optional<LocatedFrame> locate(const KeptMap& map,
                                                   const Camera& camera,
                                                   const std::vector<KeptCorner>& corners,
                                                   const std::vector<Descriptor>& descriptors);

 private:
  /// A check that went well.
  struct Sighting {
    int lookup = 0;  ///< its number
    Loop loop;
    bool is_confirmed = false;
  };
  [[nodiscard]] bool confirms(const KeptMap& map, const Sighting& one, const Sighting& other) const;

  PlaceIndex index_;
  std::vector<KeptCorner> last_corners_;  ///< of the keyframe looked up last
  std::vector<Sighting> sightings_;       ///< of the last lookups
  int num_lookups_ = 0;
  bool shows_kept_place_ = false;
};

}  // namespace stemvo
