// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "mapping/descriptors.hpp"
#include "mapping/kept_map.hpp"
#include "mapping/place_candidates.hpp"
#include "mapping/place_check.hpp"
#include "mapping/sightings.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Tells which keyframe shows a kept place. A check of one pair may be wrong where things repeat: a
/// place counts once another pair, of a neighbouring place or of the keyframes before, says the
/// same.
///
/// For each keyframe that is complete: asks(); if so describe() its corners, recognize(), and
/// unless it shows a kept place add(). The same answers on every run.
class PlaceRecognizer {
 public:
  /// Before the first keyframe: all places of another recording, none of which is too near.
  void load(const KeptMap& map);
  /// Whether the keyframe is worth a lookup: it shows enough that the last one looked up did not,
  /// some frames ago.
  [[nodiscard]] bool asks(const KeptKeyframe& keyframe) const;

  struct Question {
    const KeptMap& map;
    std::span<const int> components;  ///< of each keyframe of the map the one it belongs to
    int number;
    const KeptKeyframe& keyframe;

    /// In a map that nothing connects with the keyframe's.
    [[nodiscard]] bool is_elsewhere(int place) const {
      return components[static_cast<std::size_t>(place)] !=
             components[static_cast<std::size_t>(number)];
    }
  };
  /// The keyframe, which has landmarks as they are now and a descriptor per corner, is to be the
  /// map's keyframe `number`. Reads of the map places far before it, and where keyframes are.
  /// The loop's corners are those of both keyframes as they are given here. Where a loop is to join
  /// two maps of this recording, more sightings must agree: no motion says where they lie.
  [[nodiscard]] std::optional<Loop> recognize(const Question& question,
                                              const DescribeAs& describe_as = {});
  /// The last one that was looked up shows a place that is kept: it needs not become one.
  [[nodiscard]] bool shows_kept_place() const { return shows_kept_place_; }
  /// It becomes a place: its descriptors and corners must stay in the map.
  void add(int number, const KeptKeyframe& keyframe);

  /// Keyframes have new numbers: that of each old one, -1 where it is none any more.
  void renumber(std::span<const int> numbers) {
    index_.renumber(numbers);
    for (Place& place : places_) {
      place.keyframe = numbers[slot(place.keyframe)];
    }
    sightings_.renumber(numbers);
  }

  /// The last frame that locate() was asked for is the first that may show a place: the next one
  /// tells.
  [[nodiscard]] bool may_be_locating() const { return may_be_locating_; }
  /// Looks a frame without a pose up; its corners need no landmarks. Frames come in their order.
  [[nodiscard]] std::optional<LocatedFrame> locate(const KeptMap& map,
                                                   const Camera& camera,
                                                   const std::vector<KeptCorner>& corners,
                                                   const std::vector<Descriptor>& descriptors,
                                                   const DescribeAs& describe_as = {});

 private:
  struct Place {
    int keyframe = 0;  ///< its number
    int lookup = 0;
    double path = 0.0;   ///< path_ then
    double depth = 0.0;  ///< median; 0: it has no landmarks
  };
  /// A place to look at, and the frame's descriptors in the way in which it may look alike.
  struct Look {
    int place = 0;
    std::span<const Descriptor> seen;
    std::optional<Expectation> expected = {};
  };
  /// Looks at each place once in each way, and then at those that `look_at` names for what it sees
  /// in these, until it is enough: nullopt.
  template <typename LookAt>
  static void look_through(std::vector<Look> looks, const LookAt& look_at);
  /// Places of a sighting's map, where they are if it is right.
  [[nodiscard]] std::vector<Look> looks_beside(const Question& question,
                                               const Sighting& sighting,
                                               LookDescriptors& described) const;
  [[nodiscard]] std::vector<Look> look_alikes(LookDescriptors& described,
                                              bool in_all_ways,
                                              const std::function<bool(int)>& may_be) const;
  [[nodiscard]] std::vector<Look> expected_looks(const Question& question,
                                                 LookDescriptors& described);
  void begin_lookup(const KeptKeyframe& keyframe);
  /// The window remembers places just before in its own map.
  [[nodiscard]] bool is_far(const Question& question, int place) const {
    return place < end_of_far() || question.is_elsewhere(place);
  }
  /// Where a keyframe lies to a place of another map, by the landmarks of those around it, too.
  [[nodiscard]] std::optional<Expectation> look_around(const Question& question,
                                                       int place,
                                                       const PlaceView& recent) const;
  [[nodiscard]] std::optional<Sighting> look_at(const Question& question, const Look& look) const;
  [[nodiscard]] bool has_come_back(const KeptMap& map, const Place& place, int number) const;
  /// Keyframes below this number are far enough before the present one.
  [[nodiscard]] int end_of_far() const;
  /// A place, and so many just before and behind it.
  [[nodiscard]] std::span<const Place> places_around(int place, std::ptrdiff_t num) const;

  PlaceIndex index_;
  std::vector<Place> places_;
  std::vector<int> last_tracks_;  ///< of the keyframe looked up last
  std::vector<int> kept_tracks_;  ///< of the last one that became a place, or showed one
  int last_frame_ = 0;            ///< looked up
  Rigid3 last_pose_;              ///< world_from_camera
  double depth_ = 0.0;            ///< median, where it is known
  double path_ = 0.0;             ///< how far the view has moved: rad, depths
  Sightings sightings_;           ///< of the last lookups
  int num_lookups_ = 0;
  bool shows_kept_place_ = false;
  bool may_be_locating_ = false;
  bool is_unconfirmed_ = false;  ///< a sighting waits for others that say the same
  /// Where frames were located last, unconfirmed: map_from_camera.
  std::vector<Similarity3> located_;
};

}  // namespace stemvo
