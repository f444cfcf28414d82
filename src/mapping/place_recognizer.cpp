// SPDX-License-Identifier: MIT
#include "mapping/place_recognizer.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <ranges>

#include "geometry/median.hpp"

namespace stemvo {
namespace {

/// A keyframe is looked up that shares less than this with the last one, so many frames later.
constexpr double kMaxShared = 0.6;
constexpr int kMinFrames = 5;
/// It becomes a place where it shares less than this with the last view that is kept ..
constexpr double kMaxSharedPlace = 0.5;
/// .. and shows less than this of a kept place.
constexpr double kSamePlace = 0.2;
/// One more of a view adds nothing once so many kept places should show so much of the same at
/// about the same size.
constexpr std::ptrdiff_t kManyAlike = 4;
constexpr double kMinAlike = 0.7;
constexpr double kMaxLogAlike = 0.2;
/// A place is looked for among those so many lookups before that share no tracks: the window
/// remembers the others. It forgets those from which the camera went away, and came back: from
/// there to here is this much of its way.
constexpr int kMinLookupsApart = 6;
constexpr std::size_t kMaxTracks = 4;
constexpr double kMaxNetWay = 0.4;
constexpr int kMaxCandidates = 3;
/// So many sightings of the lookups before tell where to look, each at so many places.
constexpr std::ptrdiff_t kMaxSightings = 3;
constexpr std::size_t kMaxBeside = 4;
/// So many places before and behind one are those around it.
constexpr std::ptrdiff_t kPlacesAround = 2;
/// Bounds of the motion between a frame and one just before, both without a pose: rad, share of the
/// depth.
constexpr double kMaxMotion_rad = 0.3;
constexpr double kMaxMotion = 0.5;

std::vector<int> track_ids_of(const KeptKeyframe& keyframe) {
  const auto tracks = keyframe.corners | std::views::transform(&KeptCorner::track_id);
  return {tracks.begin(), tracks.end()};
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
  return map.keyframes[slot(number)];
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
          (is_unconfirmed_ ||
           is_share_below(kMaxShared, num_shared(last_tracks_, track_ids_of(keyframe)),
                          last_tracks_.size())));
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
  is_unconfirmed_ = false;
  last_tracks_ = track_ids_of(keyframe);
  shows_kept_place_ =
      !kept_tracks_.empty() &&
      !is_share_below(kMaxSharedPlace, num_shared(kept_tracks_, last_tracks_), kept_tracks_.size());
  sightings_.begin_lookup(num_lookups_, depth_);
}

std::optional<Loop> PlaceRecognizer::recognize(const Question& question,
                                               const DescribeAs& describe_as) {
  const KeptMap& map = question.map;
  const KeptKeyframe& keyframe = question.keyframe;
  begin_lookup(keyframe);
  // Poses tell the scale and the roll of places that they connect.
  LookDescriptors described(keyframe.descriptors, describe_as);
  const bool has_others = std::ranges::any_of(
      places_, [&](const Place& place) { return question.is_elsewhere(place.keyframe); });
  std::vector<Look> looks =
      look_alikes(described, has_others, [&](int place) { return is_far(question, place); });
  // The last ones are the nearest.
  for (const Sighting& sighting :
       sightings_.all() | std::views::reverse | std::views::take(kMaxSightings)) {
    std::ranges::copy(looks_beside(question, sighting, described), std::back_inserter(looks));
  }
  std::ranges::copy(expected_looks(question, described), std::back_inserter(looks));
  std::optional<Loop> found;
  const auto look_for_loop = [&](const Look& look) -> std::optional<std::vector<Look>> {
    std::optional<Sighting> sighting = look_at(question, look);
    if (!sighting.has_value()) {
      return std::vector<Look>();
    }
    const bool joins =
        question.is_elsewhere(look.place) && map.keyframes[slot(look.place)].frame >= 0;
    if (joins) {
      sightings_.share_what_joins(map, keyframe.corners.size(), *sighting);
    }
    const bool is_found = sightings_.confirm(map, *sighting, joins);
    is_unconfirmed_ = is_unconfirmed_ || (!is_found && (!joins || sighting->may_join()));
    if (is_found) {
      found = sighting->loop;
      if (sighting->share >= kSamePlace) {
        shows_kept_place_ = true;
        kept_tracks_ = last_tracks_;
      }
    }
    sightings_.add(*sighting);
    return is_found ? std::nullopt : std::optional(looks_beside(question, *sighting, described));
  };
  look_through(std::move(looks), look_for_loop);
  return found;
}

template <typename LookAt>
void PlaceRecognizer::look_through(std::vector<Look> looks, const LookAt& look_at) {
  const std::size_t num_candidates = looks.size();
  for (std::size_t i = 0; i < looks.size(); ++i) {
    const Look look = looks[i];
    const auto search_rad = [](const Look& one) {
      return one.expected.has_value() ? one.expected->search_rad : 0.0;
    };
    const auto is_same = [&](const Look& other) {
      return other.place == look.place && search_rad(other) == search_rad(look);
    };
    if (std::any_of(looks.begin(), looks.begin() + static_cast<std::ptrdiff_t>(i), is_same)) {
      continue;
    }
    const std::optional<std::vector<Look>> others = look_at(look);
    if (!others.has_value()) {
      return;
    }
    if (i < num_candidates) {
      std::ranges::copy(*others, std::back_inserter(looks));
    }
  }
}

std::vector<PlaceRecognizer::Look> PlaceRecognizer::look_alikes(
    LookDescriptors& described, bool in_all_ways, const std::function<bool(int)>& may_be) const {
  std::vector<std::pair<PlaceCandidate, std::span<const Descriptor>>> found;
  const auto vote = [&](std::span<const Descriptor> seen) {
    for (const PlaceCandidate& place : index_.candidates(seen, may_be, kMaxCandidates)) {
      found.emplace_back(place, seen);
    }
  };
  vote(described.as_is());
  for (std::size_t i = 0; in_all_ways && i < kOtherLooks.size(); ++i) {
    vote(described.other(kOtherLooks[i]));
  }
  std::ranges::stable_sort(found, std::greater<>(),
                           [](const auto& one) { return one.first.votes; });
  std::vector<Look> looks;
  for (const auto& [place, seen] : found) {
    if (std::ssize(looks) < kMaxCandidates &&
        std::ranges::find(looks, place.keyframe, &Look::place) == looks.end()) {
      looks.push_back({place.keyframe, seen});
    }
  }
  return looks;
}

/// Places of the same map that the camera has come back to, by the poses. Where many are kept that
/// should show the same, one more would tell nothing new.
std::vector<PlaceRecognizer::Look> PlaceRecognizer::expected_looks(const Question& question,
                                                                   LookDescriptors& described) {
  std::vector<int> places;
  for (const Place& place : places_) {
    if (is_far(question, place.keyframe) && !question.is_elsewhere(place.keyframe) &&
        has_come_back(question.map, place, question.number)) {
      places.push_back(place.keyframe);
    }
  }
  std::vector<ExpectedView> views =
      expected_views(question.map, places, question.map.pose(question.number), question.keyframe);
  const auto num_alike = std::ranges::count_if(views, [](const ExpectedView& view) {
    return view.share >= kMinAlike && std::abs(std::log(view.magnification)) < kMaxLogAlike;
  });
  shows_kept_place_ = shows_kept_place_ || num_alike >= kManyAlike;
  views.resize(std::min<std::size_t>(views.size(), kMaxCandidates));
  std::vector<Look> looks;
  for (const ExpectedView& view : views) {
    looks.push_back({view.place, described.for_view(view.magnification, 0.0),
                     Expectation{view.keyframe_from_place}});
  }
  return looks;
}

/// Where a keyframe that was sighted tells that the present one is, if it was right.
std::vector<PlaceRecognizer::Look> PlaceRecognizer::looks_beside(const Question& question,
                                                                 const Sighting& sighting,
                                                                 LookDescriptors& described) const {
  const KeptMap& map = question.map;
  const Loop& loop = sighting.loop;
  if (question.components[slot(loop.to)] != question.components[slot(question.number)]) {
    return {};  // no motion leads from there to here
  }
  const Similarity3 map_from_keyframe =
      map.pose(loop.from) * loop.from_to * map.pose(loop.to).inverse() * map.pose(question.number);
  std::vector<int> places;
  for (const Place& place : places_) {
    const int at = place.keyframe;
    if (is_far(question, at) &&
        question.components[slot(at)] == question.components[slot(loop.from)] &&
        !(at == loop.from && sighting.lookup == num_lookups_)) {
      places.push_back(at);
    }
  }
  std::vector<ExpectedView> views =
      expected_views(map, places, map_from_keyframe, question.keyframe);
  views.resize(std::min<std::size_t>(views.size(), kMaxBeside));
  // The keyframe is described by the axes of its own map.
  const double roll_rad = image_roll_rad(map_from_keyframe.rotation) -
                          image_roll_rad(map.pose(question.number).rotation);
  std::vector<Look> looks;
  for (const ExpectedView& view : views) {
    looks.push_back({view.place, described.for_view(view.magnification, roll_rad),
                     Expectation{view.keyframe_from_place, Expectation::kBySighting_rad,
                                 sighting.is_by_poses && !question.is_elsewhere(loop.from)}});
  }
  return looks;
}

std::optional<Expectation> PlaceRecognizer::look_around(const Question& question,
                                                        int place,
                                                        const PlaceView& recent) const {
  const KeptMap& map = question.map;
  std::vector<PlaceAround> around;
  for (const Place& one : places_around(place, kPlacesAround)) {
    if (question.components[slot(one.keyframe)] == question.components[slot(place)]) {
      around.push_back({map.pose(place).inverse() * map.pose(one.keyframe),
                        view_of(keyframe_of(map, one.keyframe))});
    }
  }
  return expect_by_places(keyframe_of(map, place).camera, around, recent);
}

std::optional<Sighting> PlaceRecognizer::look_at(const Question& question, const Look& look) const {
  const auto& [map, components, number, keyframe] = question;
  const KeptKeyframe& old = keyframe_of(map, look.place);
  if (!is_far(question, look.place) ||
      (num_shared(track_ids_of(old), last_tracks_) > kMaxTracks &&
       !has_come_back(map, places_around(look.place, 0).front(), number))) {
    return std::nullopt;
  }
  const PlaceView recent{keyframe.camera, keyframe.corners, look.seen};
  std::optional<Loop> loop = check_place(view_of(old), recent, look.expected);
  if (!loop.has_value() && !look.expected.has_value() && question.is_elsewhere(look.place)) {
    if (const auto expected = look_around(question, look.place, recent)) {
      loop = check_place(view_of(old), recent, expected);
    }
  }
  if (!loop.has_value()) {
    return std::nullopt;
  }
  loop->from = look.place;
  loop->to = number;
  const double share =
      static_cast<double>(loop->corners.size()) / static_cast<double>(keyframe.corners.size());
  const int num_in_common = num_in_view(old, keyframe, loop->from_to.inverse());
  return Sighting{.lookup = num_lookups_,
                  .share = share,
                  .common = static_cast<double>(loop->corners.size()) / std::max(1, num_in_common),
                  .is_by_poses = look.expected.has_value() && look.expected->is_certain,
                  .loop = std::move(*loop)};
}

bool PlaceRecognizer::has_come_back(const KeptMap& map, const Place& place, int number) const {
  const Similarity3 net = map.pose(place.keyframe).inverse() * map.pose(number);
  return place.depth > 0.0 && change_of_view(net, place.depth) < kMaxNetWay * (path_ - place.path);
}

std::span<const PlaceRecognizer::Place> PlaceRecognizer::places_around(int place,
                                                                       std::ptrdiff_t num) const {
  const auto at = std::ranges::lower_bound(places_, place, {}, &Place::keyframe);
  return {at - std::min(num, at - places_.begin()), at + std::min(num + 1, places_.end() - at)};
}

void PlaceRecognizer::add(int number, const KeptKeyframe& keyframe) {
  index_.add(number, keyframe.descriptors);
  places_.push_back({number, num_lookups_, path_, median_depth(keyframe.corners)});
  kept_tracks_ = track_ids_of(keyframe);
}

std::optional<LocatedFrame> PlaceRecognizer::locate(const KeptMap& map,
                                                    const Camera& camera,
                                                    const std::vector<KeptCorner>& corners,
                                                    const std::vector<Descriptor>& descriptors,
                                                    const DescribeAs& describe_as) {
  const std::vector<Similarity3> before = std::exchange(located_, {});
  LookDescriptors described(descriptors, describe_as);
  std::optional<LocatedFrame> located;
  const auto look_for_pose = [&](const Look& look) -> std::optional<std::vector<Look>> {
    std::vector<Look> others;
    const KeptKeyframe& old = keyframe_of(map, look.place);
    auto found = locate_in_place(view_of(old), {camera, corners, look.seen});
    if (!found.has_value()) {
      return others;
    }
    const Similarity3 map_from_camera =
        map.pose(look.place) * Similarity3(found->keyframe_from_camera);
    const auto is_near = [&](double max_turn_rad, double max_shift) {
      return [&, max_turn_rad, max_shift](const Similarity3& other) {
        const Similarity3 difference = map_from_camera.inverse() * other;
        return turn_of(difference) < max_turn_rad &&
               difference.translation.norm() < max_shift * median_depth(old.corners);
      };
    };
    const bool is_certain =
        std::ranges::any_of(located_, is_near(kMaxSameTurn_rad, kMaxSameShift)) ||
        std::ranges::any_of(before, is_near(kMaxMotion_rad, kMaxMotion));
    located_.push_back(map_from_camera);
    if (!is_certain) {
      for (const Place& neighbour : places_around(look.place, 1)) {
        others.push_back({neighbour.keyframe, look.seen});
      }
      return others;
    }
    located = std::move(found);
    located->keyframe = look.place;
    return std::nullopt;
  };
  look_through(look_alikes(described, true, [](int) { return true; }), look_for_pose);
  may_be_locating_ = !located && before.empty() && !located_.empty();
  return located;
}

}  // namespace stemvo
