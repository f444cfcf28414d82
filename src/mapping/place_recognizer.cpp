// SPDX-License-Identifier: MIT
#include "mapping/place_recognizer.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "geometry/median.hpp"

namespace stemvo {
namespace {

/// A keyframe is looked up that shares less than this with the last one.
constexpr double kMaxShared = 0.4;
/// A place is looked for among keyframes this far before: nearer ones are remembered by tracks.
constexpr int kMinApart = 40;
constexpr int kMaxCandidates = 4;
/// Checks of the last lookups may confirm each other.
constexpr int kMaxLookupsApart = 3;
/// Two checks that say the same differ by less: log scale, rad, share of the depth and of the way
/// between them.
constexpr double kMaxLogScale = 0.1;
constexpr double kMaxTurn_rad = 0.05;
constexpr double kMaxShift = 0.1;
/// A keyframe that shows so much of a kept place is none of its own.
constexpr double kSamePlace = 0.3;

double share_of(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

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

}  // namespace

bool PlaceRecognizer::asks(const KeptKeyframe& keyframe) const {
  std::size_t num_shared = 0;
  auto last = last_corners_.begin();
  for (const KeptCorner& corner : keyframe.corners) {
    last = std::find_if(last, last_corners_.end(),
                        [&](const KeptCorner& other) { return other.track_id >= corner.track_id; });
    num_shared += last != last_corners_.end() && last->track_id == corner.track_id ? 1 : 0;
  }
  return share_of(num_shared, last_corners_.size()) < kMaxShared;
}

std::optional<Loop> PlaceRecognizer::recognize(const KeptMap& map,
                                               int number,
                                               const KeptKeyframe& keyframe) {
  last_corners_ = keyframe.corners;
  ++num_lookups_;
  shows_kept_place_ = false;
  std::erase_if(sightings_, [&](const Sighting& sighting) {
    return sighting.lookup + kMaxLookupsApart < num_lookups_;
  });
  std::optional<Loop> best;
  for (const PlaceCandidate& candidate :
       index_.candidates(keyframe.descriptors, number - kMinApart, kMaxCandidates)) {
    std::optional<Loop> loop =
        check_place(view_of(keyframe_of(map, candidate.keyframe)), view_of(keyframe));
    if (!loop.has_value()) {
      continue;
    }
    loop->from = candidate.keyframe;
    loop->to = number;
    Sighting sighting{num_lookups_, *loop};
    for (Sighting& other : sightings_) {
      if (other.loop.from != sighting.loop.from && confirms(map, sighting, other)) {
        sighting.is_confirmed = true;
        other.is_confirmed = true;
      }
    }
    sightings_.push_back(std::move(sighting));
  }
  for (const Sighting& sighting : sightings_) {
    if (sighting.lookup == num_lookups_ && sighting.is_confirmed &&
        (!best.has_value() || sighting.loop.corners.size() > best->corners.size())) {
      best = sighting.loop;
    }
  }
  shows_kept_place_ =
      best.has_value() && share_of(best->corners.size(), keyframe.corners.size()) >= kSamePlace;
  return best;
}

bool PlaceRecognizer::confirms(const KeptMap& map,
                               const Sighting& one,
                               const Sighting& other) const {
  const Similarity3 map_from_one = pose_of(map, one.loop.from) * one.loop.from_to;
  const Similarity3 map_from_other = pose_of(map, other.loop.from) * other.loop.from_to;
  const Similarity3 other_from_one =
      pose_of(map, other.loop.to).inverse() * pose_of(map, one.loop.to);
  // The identity, if both are right.
  const Similarity3 difference = map_from_one.inverse() * map_from_other * other_from_one;
  const double length = median_depth(last_corners_) + (other_from_one.translation).norm();
  return std::abs(std::log(difference.scale)) < kMaxLogScale &&
         Eigen::Quaterniond::Identity().angularDistance(difference.rotation) < kMaxTurn_rad &&
         difference.translation.norm() < kMaxShift * length;
}

void PlaceRecognizer::add(int number, const KeptKeyframe& keyframe) {
  index_.add(number, keyframe.descriptors);
}

std::optional<LocatedFrame> PlaceRecognizer::locate(const KeptMap& map,
                                                    const Camera& camera,
                                                    const std::vector<KeptCorner>& corners,
                                                    const std::vector<Descriptor>& descriptors) {
  std::optional<LocatedFrame> best;
  std::size_t num_agreeing = 0;
  std::vector<Similarity3> map_from_camera;
  for (const PlaceCandidate& candidate :
       index_.candidates(descriptors, static_cast<int>(map.keyframes.size()), kMaxCandidates)) {
    const KeptKeyframe& old = keyframe_of(map, candidate.keyframe);
    const auto found = locate_in_place(view_of(old), {camera, corners, descriptors});
    if (!found.has_value()) {
      continue;
    }
    map_from_camera.push_back(pose_of(map, candidate.keyframe) *
                              Similarity3(found->old_from_camera));
    if (found->corners.size() > num_agreeing) {
      num_agreeing = found->corners.size();
      best = LocatedFrame{candidate.keyframe, found->old_from_camera, {}};
      for (const auto& [mine, other] : found->corners) {
        best->landmarks.emplace_back(
            corners[static_cast<std::size_t>(other)].track_id,
            old.corners[static_cast<std::size_t>(mine)].in_camera.cast<double>());
      }
    }
  }
  return best;
}

}  // namespace stemvo
