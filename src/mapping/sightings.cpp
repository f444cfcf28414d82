// SPDX-License-Identifier: MIT
#include "mapping/sightings.hpp"

#include <cmath>
#include <iterator>
#include <ranges>
#include <set>

namespace stemvo {
namespace {

constexpr int kMaxLookupsApart = 3;
/// Sightings of so many keyframes say that two maps are one.
constexpr std::ptrdiff_t kMinJoinLookups = 3;
constexpr double kMaxLogScale = 0.1;

}  // namespace

void Sightings::begin_lookup(int number, double depth) {
  depth_ = depth;
  std::erase_if(sightings_, [&](const Sighting& sighting) {
    return sighting.lookup + kMaxLookupsApart < number;
  });
}

bool Sightings::say_the_same(const KeptMap& map, const Sighting& a, const Sighting& b) const {
  const Similarity3 a_from_b = map.pose(a.loop.to).inverse() * map.pose(b.loop.to);
  // The identity, if both are right.
  const Similarity3 difference = (map.pose(a.loop.from) * a.loop.from_to * a_from_b).inverse() *
                                 map.pose(b.loop.from) * b.loop.from_to;
  return std::abs(std::log(difference.scale)) < kMaxLogScale &&
         Eigen::Quaterniond::Identity().angularDistance(difference.rotation) < kMaxSameTurn_rad &&
         difference.translation.norm() < kMaxSameShift * (depth_ + a_from_b.translation.norm());
}

void Sightings::share_what_joins(const KeptMap& map, std::size_t num_corners, Sighting& sighting) {
  std::set<int> explained;
  std::vector<Sighting*> same = {&sighting};
  for (Sighting& other : sightings_) {
    if (other.lookup == sighting.lookup && say_the_same(map, other, sighting)) {
      same.push_back(&other);
    }
  }
  for (const Sighting* one : same) {
    std::ranges::copy(one->loop.corners | std::views::values,
                      std::inserter(explained, explained.end()));
  }
  for (Sighting* one : same) {
    one->share = static_cast<double>(explained.size()) / static_cast<double>(num_corners);
  }
}

bool Sightings::confirm(const KeptMap& map, const Sighting& sighting, bool joins) const {
  if (joins && !sighting.may_join()) {
    return false;
  }
  std::set<int> lookups = {sighting.lookup};
  bool is_confirmed = false;
  for (const Sighting& other : sightings_) {
    const bool is_another_look = other.lookup != sighting.lookup;
    const bool is_same_view = other.loop.from == sighting.loop.from &&
                              !((joins || sighting.is_by_poses) && is_another_look);
    if (!is_same_view && (!joins || other.may_join()) && say_the_same(map, other, sighting)) {
      is_confirmed = true;
      lookups.insert(other.lookup);
    }
  }
  return joins ? std::ssize(lookups) >= kMinJoinLookups : is_confirmed;
}

}  // namespace stemvo
