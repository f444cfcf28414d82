// SPDX-License-Identifier: MIT
#include "mapping/place_recognizer.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <limits>

#include "geometry/median.hpp"
#include "mapping/expected_views.hpp"

namespace stemvo {
namespace {

/// A keyframe is looked up that shares less than this with the last one, so many frames later.
constexpr double kMaxShared = 0.6;
constexpr int kMinFrames = 5;
/// It becomes a place where it shares less than this with the last view that is kept ..
constexpr double kMaxSharedPlace = 0.5;
/// .. and shows less than this of a kept place.
constexpr double kSamePlace = 0.2;
/// A place is looked for among those so many lookups before that share no tracks: the window
/// remembers the others. It forgets those from which the camera went away, and came back: from
/// there to here is this much of its way.
constexpr int kMinLookupsApart = 6;
constexpr std::size_t kMaxTracks = 4;
constexpr double kMaxNetWay = 0.4;
constexpr int kMaxCandidates = 3;
/// Checks of the last lookups may confirm each other.
constexpr int kMaxLookupsApart = 3;
/// A join of two maps takes this share of the corners, and so many sightings that say the same:
/// streets that share a house look alike too, but not all of it.
constexpr double kMinJoinShare = 0.25;
constexpr std::ptrdiff_t kMinJoinSightings = 3;
/// Two checks that say the same differ by less: log scale, rad, share of the depth and of the way
/// between them.
constexpr double kMaxLogScale = 0.1;
constexpr double kMaxTurn_rad = 0.05;
constexpr double kMaxShift = 0.1;
/// Bounds of the motion between a frame and one just before, both without a pose: rad, share of the
/// depth.
constexpr double kMaxMotion_rad = 0.3;
constexpr double kMaxMotion = 0.5;

std::vector<int> track_ids_of(const KeptKeyframe& keyframe) {
  std::vector<int> tracks;
  for (const KeptCorner& corner : keyframe.corners) {
    tracks.push_back(corner.track_id);
  }
  return tracks;
}

std::size_t num_shared(const std::vector<int>& a, const std::vector<int>& b) {
  std::vector<int> shared;
  std::ranges::set_intersection(a, b, std::back_inserter(shared));
  return shared.size();
}

bool is_share_below(double bound, std::size_t part, std::size_t whole) {
  return static_cast<double>(part) < bound * static_cast<double>(whole);
}

/// Median over the landmarks; 0 where there are none.
double median_depth(const std::vector<KeptCorner>& corners) {
  std::vector<double> depths;
  for (const KeptCorner& corner : corners) {
    if (corner.has_landmark()) {
      depths.push_back(corner.in_camera.z());
    }
  }
  return depths.empty() ? 0.0 : median(std::move(depths));
}

PlaceView view_of(const KeptKeyframe& keyframe) {
  return {keyframe.camera, keyframe.corners, keyframe.descriptors};
}

const KeptKeyframe& keyframe_of(const KeptMap& map, int number) {
  return map.keyframes[static_cast<std::size_t>(number)];
}
const Similarity3& pose_of(const KeptMap& map, int number) {
  return map.map_from_keyframe[static_cast<std::size_t>(number)];
}

double turn_of(const Similarity3& motion) {
  return Eigen::Quaterniond::Identity().angularDistance(motion.rotation);
}

/// How much of the view a motion changes: rad, depths.
double change_of_view(const Similarity3& motion, double depth) {
  return turn_of(motion) + (depth > 0.0 ? motion.translation.norm() / depth : 0.0);
}

}  // namespace

void PlaceRecognizer::load(const KeptMap& map) {
  for (int i = 0; i < static_cast<int>(map.keyframes.size()); ++i) {
    if (!keyframe_of(map, i).descriptors.empty()) {
      add(i, keyframe_of(map, i));
      places_.back().lookup = -kMinLookupsApart;
      places_.back().path = -std::numeric_limits<double>::infinity();
    }
  }
}

int PlaceRecognizer::end_of_far() const {
  const auto end =
      std::ranges::upper_bound(places_, num_lookups_ - kMinLookupsApart, {}, &Place::lookup);
  return end == places_.begin() ? 0 : std::prev(end)->keyframe + 1;
}

bool PlaceRecognizer::asks(const KeptKeyframe& keyframe) const {
  return num_lookups_ == 0 ||
         (keyframe.frame - last_frame_ >= kMinFrames &&
          is_share_below(kMaxShared, num_shared(last_tracks_, track_ids_of(keyframe)),
                         last_tracks_.size()));
}

/// The keyframe is the one that is looked up now.
void PlaceRecognizer::begin_lookup(const KeptKeyframe& keyframe) {
  const double depth = median_depth(keyframe.corners);
  depth_ = depth > 0.0 ? depth : depth_;
  path_ +=
      num_lookups_ == 0
          ? 0.0
          : change_of_view(Similarity3(last_pose_.inverse() * keyframe.world_from_camera), depth_);
  ++num_lookups_;
  last_pose_ = keyframe.world_from_camera;
  last_frame_ = keyframe.frame;
  last_tracks_ = track_ids_of(keyframe);
  shows_kept_place_ =
      !kept_tracks_.empty() &&
      !is_share_below(kMaxSharedPlace, num_shared(kept_tracks_, last_tracks_), kept_tracks_.size());
  std::erase_if(sightings_, [&](const Sighting& sighting) {
    return sighting.lookup + kMaxLookupsApart < num_lookups_;
  });
}

std::optional<Loop> PlaceRecognizer::recognize(const KeptMap& map,
                                               std::span<const int> components,
                                               int number,
                                               const KeptKeyframe& keyframe,
                                               const DescribeAt& describe_at) {
  begin_lookup(keyframe);
  const auto joins = [&](int place) {
    return components[static_cast<std::size_t>(place)] !=
               components[static_cast<std::size_t>(number)] &&
           keyframe_of(map, place).frame >= 0;
  };
  // Poses tell the scale of places that they connect.
  ScaledDescriptors scales(keyframe.descriptors, describe_at);
  const bool has_others = std::ranges::any_of(places_, [&](const Place& place) {
    return components[static_cast<std::size_t>(place.keyframe)] !=
           components[static_cast<std::size_t>(number)];
  });
  std::vector<Look> to_check = look_alikes(scales, has_others, end_of_far());
  std::ranges::copy(expected_looks(map, components, number, keyframe, scales),
                    std::back_inserter(to_check));
  const std::size_t num_candidates = to_check.size();
  for (std::size_t i = 0; i < to_check.size(); ++i) {
    const Look look = to_check[i];
    const int place = look.place;
    if (std::any_of(to_check.begin(), to_check.begin() + static_cast<std::ptrdiff_t>(i),
                    [&](const Look& other) {
                      return other.place == place &&
                             other.expected.has_value() == look.expected.has_value();
                    })) {
      continue;
    }
    const std::optional<Sighting> sighting = look_at(map, look, number, keyframe);
    if (!sighting.has_value()) {
      continue;
    }
    if (is_confirmed(map, *sighting, joins(place))) {
      sightings_.push_back(*sighting);
      if (sighting->share >= kSamePlace) {
        shows_kept_place_ = true;
        kept_tracks_ = last_tracks_;
      }
      return sighting->loop;
    }
    sightings_.push_back(*sighting);
    if (i < num_candidates) {
      for (const int neighbour : neighbours_of(place)) {
        to_check.push_back({neighbour, look.seen, {}});
      }
    }
  }
  return std::nullopt;
}

std::vector<PlaceRecognizer::Look> PlaceRecognizer::look_alikes(ScaledDescriptors& scales,
                                                                bool at_all,
                                                                int before) const {
  std::vector<std::pair<PlaceCandidate, std::span<const Descriptor>>> found;
  const auto vote = [&](std::span<const Descriptor> seen) {
    for (const PlaceCandidate& place : index_.candidates(seen, before, kMaxCandidates)) {
      found.emplace_back(place, seen);
    }
  };
  vote(scales.at_one());
  for (std::size_t i = 0; at_all && i < kOtherScales.size(); ++i) {
    vote(scales.other(i));
  }
  std::ranges::stable_sort(found, std::greater<>(),
                           [](const auto& one) { return one.first.votes; });
  std::vector<Look> looks;
  for (const auto& [place, seen] : found) {
    if (std::ssize(looks) < kMaxCandidates &&
        std::ranges::find(looks, place.keyframe, &Look::place) == looks.end()) {
      looks.push_back({place.keyframe, seen, {}});
    }
  }
  return looks;
}

/// Places of the same map that the camera has come back to, by the poses.
std::vector<PlaceRecognizer::Look> PlaceRecognizer::expected_looks(
    const KeptMap& map,
    std::span<const int> components,
    int number,
    const KeptKeyframe& keyframe,
    ScaledDescriptors& scales) const {
  const auto component_of = [&](int node) { return components[static_cast<std::size_t>(node)]; };
  std::vector<int> places;
  for (const Place& place : places_) {
    if (place.keyframe < end_of_far() && component_of(place.keyframe) == component_of(number) &&
        has_come_back(map, place, number)) {
      places.push_back(place.keyframe);
    }
  }
  std::vector<ExpectedView> views = expected_views(map, places, number, keyframe);
  views.resize(std::min<std::size_t>(views.size(), kMaxCandidates));
  std::vector<Look> looks;
  for (const ExpectedView& view : views) {
    looks.push_back(
        {view.place, scales.for_magnification(view.magnification), view.keyframe_from_place});
  }
  return looks;
}

std::optional<PlaceRecognizer::Sighting> PlaceRecognizer::look_at(
    const KeptMap& map, const Look& look, int number, const KeptKeyframe& keyframe) const {
  const int place = look.place;
  const KeptKeyframe& old = keyframe_of(map, place);
  if (place >= end_of_far() || (num_shared(track_ids_of(old), last_tracks_) > kMaxTracks &&
                                !has_come_back(map, place_of(place), number))) {
    return std::nullopt;
  }
  std::optional<Loop> loop =
      check_place(view_of(old), {keyframe.camera, keyframe.corners, look.seen}, look.expected);
  if (!loop.has_value()) {
    return std::nullopt;
  }
  loop->from = place;
  loop->to = number;
  const double share =
      static_cast<double>(loop->corners.size()) / static_cast<double>(keyframe.corners.size());
  return Sighting{num_lookups_, share, look.expected.has_value(), std::move(*loop)};
}

bool PlaceRecognizer::has_come_back(const KeptMap& map, const Place& place, int number) const {
  const Similarity3 net = pose_of(map, place.keyframe).inverse() * pose_of(map, number);
  return place.depth > 0.0 && change_of_view(net, place.depth) < kMaxNetWay * (path_ - place.path);
}

/// By another sighting, of another place; of keyframes that were looked up before, too, where two
/// maps are to be joined.
bool PlaceRecognizer::is_confirmed(const KeptMap& map, const Sighting& sighting, bool joins) const {
  const Loop& loop = sighting.loop;
  if (joins && sighting.share < kMinJoinShare) {
    return false;
  }
  const Similarity3 map_from_camera = pose_of(map, loop.from) * loop.from_to;
  const auto num = std::ranges::count_if(sightings_, [&](const Sighting& other) {
    const bool is_same_view =
        other.loop.from == loop.from && (!sighting.was_expected || other.lookup == sighting.lookup);
    if (is_same_view ||
        (joins && (other.lookup == sighting.lookup || other.share < kMinJoinShare))) {
      return false;
    }
    const Similarity3 other_from_camera =
        pose_of(map, other.loop.to).inverse() * pose_of(map, loop.to);
    // The identity, if both are right.
    const Similarity3 difference = map_from_camera.inverse() * pose_of(map, other.loop.from) *
                                   other.loop.from_to * other_from_camera;
    return std::abs(std::log(difference.scale)) < kMaxLogScale &&
           turn_of(difference) < kMaxTurn_rad &&
           difference.translation.norm() <
               kMaxShift * (depth_ + other_from_camera.translation.norm());
  });
  return num >= (joins ? kMinJoinSightings - 1 : 1);
}

const PlaceRecognizer::Place& PlaceRecognizer::place_of(int keyframe) const {
  return *std::ranges::lower_bound(places_, keyframe, {}, &Place::keyframe);
}

std::vector<int> PlaceRecognizer::neighbours_of(int place) const {
  const auto at = std::ranges::lower_bound(places_, place, {}, &Place::keyframe);
  std::vector<int> neighbours;
  if (at != places_.begin()) {
    neighbours.push_back(std::prev(at)->keyframe);
  }
  if (at != places_.end() && std::next(at) != places_.end()) {
    neighbours.push_back(std::next(at)->keyframe);
  }
  return neighbours;
}

void PlaceRecognizer::add(int number, const KeptKeyframe& keyframe) {
  index_.add(number, keyframe.descriptors);
  places_.push_back({number, num_lookups_, path_, median_depth(keyframe.corners)});
  kept_tracks_ = track_ids_of(keyframe);
}

void PlaceRecognizer::renumber(std::span<const int> numbers) {
  const auto number_of = [&](int keyframe) { return numbers[static_cast<std::size_t>(keyframe)]; };
  index_.renumber(numbers);
  for (Place& place : places_) {
    place.keyframe = number_of(place.keyframe);
  }
  for (Sighting& sighting : sightings_) {
    sighting.loop.from = number_of(sighting.loop.from);
    sighting.loop.to = number_of(sighting.loop.to);
  }
  std::erase_if(sightings_, [](const Sighting& sighting) { return sighting.loop.to < 0; });
}

std::optional<LocatedFrame> PlaceRecognizer::locate(const KeptMap& map,
                                                    const Camera& camera,
                                                    const std::vector<KeptCorner>& corners,
                                                    const std::vector<Descriptor>& descriptors,
                                                    const DescribeAt& describe_at) {
  const std::vector<Similarity3> before = std::exchange(located_, {});
  may_be_locating_ = false;
  ScaledDescriptors scales(descriptors, describe_at);
  std::vector<Look> to_check = look_alikes(scales, true, static_cast<int>(map.keyframes.size()));
  const std::size_t num_candidates = to_check.size();
  for (std::size_t i = 0; i < to_check.size(); ++i) {
    const Look look = to_check[i];
    const int place = look.place;
    const auto end = to_check.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::ranges::find(to_check.begin(), end, place, &Look::place) != end) {
      continue;
    }
    const KeptKeyframe& old = keyframe_of(map, place);
    const auto found = locate_in_place(view_of(old), {camera, corners, look.seen});
    if (!found.has_value()) {
      continue;
    }
    const Similarity3 map_from_camera = pose_of(map, place) * Similarity3(found->old_from_camera);
    const auto agrees = [&](const Similarity3& other, double max_turn_rad, double max_shift) {
      const Similarity3 difference = map_from_camera.inverse() * other;
      return turn_of(difference) < max_turn_rad &&
             difference.translation.norm() < max_shift * median_depth(old.corners);
    };
    const auto is_same = [&](const Similarity3& other) {
      return agrees(other, kMaxTurn_rad, kMaxShift);
    };
    const auto is_near = [&](const Similarity3& other) {
      return agrees(other, kMaxMotion_rad, kMaxMotion);
    };
    const bool is_certain =
        std::ranges::any_of(located_, is_same) || std::ranges::any_of(before, is_near);
    located_.push_back(map_from_camera);
    if (is_certain) {
      LocatedFrame located{place, found->old_from_camera, {}};
      for (const auto& [mine, other] : found->corners) {
        located.landmarks.emplace_back(
            corners[static_cast<std::size_t>(other)].track_id,
            old.corners[static_cast<std::size_t>(mine)].in_camera.cast<double>());
      }
      return located;
    }
    if (i < num_candidates) {
      for (const int neighbour : neighbours_of(place)) {
        to_check.push_back({neighbour, look.seen, {}});
      }
    }
  }
  may_be_locating_ = before.empty() && !located_.empty();
  return std::nullopt;
}

}  // namespace stemvo
