// SPDX-License-Identifier: MIT
#include "mapping/place_candidates.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <random>
#include <utility>

#include "geometry/median.hpp"
#include "instruction_set.hpp"
#include "mapping/descriptors.hpp"

namespace stemvo {
namespace {

/// A descriptor votes for places that have one this near: nearer than most that do not belong
/// together.
constexpr int kVoteBits = 60;
/// Candidates have so many votes, and so many times those of the best but so many.
constexpr double kMinVotes = 2.0;
constexpr double kAboveChance = 1.3;
constexpr std::ptrdiff_t kChance = 8;

/// Views that share less are hard to match.
constexpr double kMinShare = 0.3;
/// So many corners stand for all.
constexpr std::size_t kSamples = 64;

/// A landmark in the camera of `by`; nullopt: it has none, or it lies outside of the image.
std::optional<Eigen::Vector3d> seen_by(const KeptKeyframe& by,
                                       const Similarity3& by_from_of,
                                       const KeptCorner& corner) {
  const Eigen::Vector3d x = by_from_of * corner.in_camera.cast<double>();
  if (!corner.has_landmark() || x.z() <= 0.0) {
    return std::nullopt;
  }
  const Eigen::Vector2d uv = by.camera.project(x);
  const bool is_inside =
      uv.x() >= 0.0 && uv.y() >= 0.0 && uv.x() < by.camera.width_px && uv.y() < by.camera.height_px;
  return is_inside ? std::optional(x) : std::nullopt;
}

struct SharedView {
  double share = 0.0;  ///< of the landmarks
  double magnification = 1.0;
};

/// How much `by` sees of the landmarks of `of`, and how large.
SharedView shared_view(const KeptKeyframe& of,
                       const KeptKeyframe& by,
                       const Similarity3& by_from_of) {
  int num_landmarks = 0;
  std::vector<double> nearer;
  const std::size_t step = 1 + of.corners.size() / kSamples;
  for (std::size_t i = 0; i < of.corners.size(); i += step) {
    if (!of.corners[i].has_landmark()) {
      continue;
    }
    ++num_landmarks;
    if (const auto x = seen_by(by, by_from_of, of.corners[i])) {
      nearer.push_back(by_from_of.scale * static_cast<double>(of.corners[i].in_camera.z()) /
                       x->z());
    }
  }
  if (nearer.empty()) {
    return {};
  }
  const double share = static_cast<double>(nearer.size()) / num_landmarks;
  return {share, median(std::move(nearer)) * by.camera.mean_focal_px() / of.camera.mean_focal_px()};
}

}  // namespace

int num_in_view(const KeptKeyframe& of, const KeptKeyframe& by, const Similarity3& by_from_of) {
  return static_cast<int>(std::ranges::count_if(of.corners, [&](const KeptCorner& corner) {
    return seen_by(by, by_from_of, corner).has_value();
  }));
}

PlaceIndex::PlaceIndex() {
  std::mt19937 random;  // NOLINT: the same on every run
  for (auto& table : bits_) {
    for (std::uint8_t& bit : table) {
      bit = static_cast<std::uint8_t>(random() % 256);
    }
  }
  tables_.fill(std::vector<Cell>(std::size_t{1} << kBits));
}

void PlaceIndex::add(int keyframe, std::span<const Descriptor> descriptors) {
  const auto place = static_cast<std::uint32_t>(keyframes_.size());
  keyframes_.push_back(keyframe);
  for (const Descriptor& descriptor : descriptors) {
    if (descriptor == kNoDescriptor) {
      continue;
    }
    const auto entry = static_cast<std::uint32_t>(entries_.size());
    entries_.push_back({descriptor, place});
    for (int table = 0; table < kTables; ++table) {
      tables_[static_cast<std::size_t>(table)][cell_of(descriptor, table)].push_back(entry);
    }
  }
}

/// Each descriptor has one vote, which the places that have its like share.
STEMVO_INLINE void PlaceIndex::vote(const PlaceIndex& index,
                                    std::span<const Descriptor> descriptors,
                                    std::vector<Votes>& votes) {
  std::vector<std::uint32_t> places;  // that a descriptor votes for
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    if (descriptors[i] == kNoDescriptor) {
      continue;
    }
    places.clear();
    for (int table = 0; table < kTables; ++table) {
      for (const std::uint32_t at :
           index.tables_[static_cast<std::size_t>(table)][index.cell_of(descriptors[i], table)]) {
        const Entry& entry = index.entries_[at];
        Votes& place = votes[entry.place];
        if (place.counts && place.last_by != static_cast<int>(i) &&
            differing_bits(descriptors[i], entry.descriptor) <= kVoteBits) {
          place.last_by = static_cast<int>(i);
          places.push_back(entry.place);
        }
      }
    }
    for (const std::uint32_t place : places) {
      votes[place].num += 1.0 / static_cast<double>(places.size());
    }
  }
}

std::vector<PlaceCandidate> PlaceIndex::candidates(std::span<const Descriptor> descriptors,
                                                   const std::function<bool(int keyframe)>& may_be,
                                                   int max_candidates) const {
  std::vector<Votes> votes(keyframes_.size());
  for (std::size_t place = 0; place < votes.size(); ++place) {
    votes[place].counts = may_be(keyframes_[place]);
  }
  run_body<&PlaceIndex::vote>(*this, descriptors, votes);
  std::vector<PlaceCandidate> best;
  for (std::size_t place = 0; place < votes.size(); ++place) {
    if (votes[place].num > 0.0) {
      best.push_back({keyframes_[place], votes[place].num});
    }
  }
  const auto is_better = [](const PlaceCandidate& a, const PlaceCandidate& b) {
    return a.votes != b.votes ? a.votes > b.votes : a.keyframe < b.keyframe;
  };
  const auto count = std::min(std::max<std::ptrdiff_t>(max_candidates, kChance), std::ssize(best));
  std::ranges::partial_sort(best, best.begin() + count, is_better);
  // Votes by chance are alike: a place that is shown stands out of them.
  const double chance = std::ssize(best) < kChance ? 0.0 : best[kChance - 1].votes;
  best.resize(static_cast<std::size_t>(count));
  std::erase_if(best, [&](const PlaceCandidate& place) {
    return place.votes < kMinVotes || place.votes < kAboveChance * chance;
  });
  best.resize(std::min(best.size(), static_cast<std::size_t>(max_candidates)));
  return best;
}

std::vector<ExpectedView> expected_views(const KeptMap& map,
                                         std::span<const int> places,
                                         const Similarity3& map_from_keyframe,
                                         const KeptKeyframe& keyframe) {
  std::vector<ExpectedView> views;
  for (const int place : places) {
    const KeptKeyframe& old = map.keyframes[slot(place)];
    const Similarity3 motion = map_from_keyframe.inverse() * map.pose(place);
    const SharedView there = shared_view(old, keyframe, motion);
    if (there.share < kMinShare) {
      continue;
    }
    const double share = std::min(there.share, shared_view(keyframe, old, motion.inverse()).share);
    if (share >= kMinShare) {
      views.push_back({place, motion, share, there.magnification});
    }
  }
  std::ranges::stable_sort(views, std::greater<>(), &ExpectedView::share);
  return views;
}

}  // namespace stemvo
