// SPDX-License-Identifier: MIT
#include "mapping/map_tracks.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <unordered_map>

#include "mapping/pose_graph.hpp"

namespace stemvo {
namespace {

/// A track that keyframes between do not show is the same still: they keep only so many corners.
constexpr int kMaxGap = 8;
/// A loop is contradicted where it is off by more, all seven errors together.
constexpr double kMaxSigmas = 8.0;

/// Corners of all keyframes, numbered through, and which are one landmark.
class SameLandmark {
 public:
  explicit SameLandmark(const KeptMap& map) : begin_{0} {
    for (const KeptKeyframe& keyframe : map.keyframes) {
      begin_.push_back(begin_.back() + keyframe.corners.size());
    }
    first_.resize(begin_.back());
    std::iota(first_.begin(), first_.end(), 0U);
  }
  [[nodiscard]] std::size_t index_of(int keyframe, std::size_t corner) const {
    return begin_[slot(keyframe)] + corner;
  }
  /// The first of the corners that are the same.
  [[nodiscard]] std::size_t first_of(std::size_t index) {
    while (first_[index] != index) {
      index = first_[index] = first_[first_[index]];
    }
    return index;
  }
  void join(std::size_t a, std::size_t b) {
    const auto [low, high] = std::minmax({first_of(a), first_of(b)});
    first_[high] = low;
  }

 private:
  std::vector<std::size_t> begin_;
  std::vector<std::size_t> first_;
};

void join_tracks(const KeptMap& map, SameLandmark& same) {
  struct Last {
    int keyframe;
    std::size_t index;
  };
  std::unordered_map<int, Last> last;  // by track id
  for (int i = 0; i < static_cast<int>(map.keyframes.size()); ++i) {
    const auto& corners = map.keyframes[slot(i)].corners;
    for (std::size_t j = 0; j < corners.size(); ++j) {
      const Last here{i, same.index_of(i, j)};
      const auto [at, is_new] = last.try_emplace(corners[j].track_id, here);
      if (!is_new && i - at->second.keyframe <= kMaxGap) {
        same.join(at->second.index, here.index);
      }
      at->second = here;
    }
  }
}

void join_loops(const KeptMap& map, SameLandmark& same) {
  for (const Loop& loop : map.loops) {
    if (sigmas_off(map, loop) > kMaxSigmas) {
      continue;
    }
    for (const auto& [from, to] : loop.corners) {
      same.join(same.index_of(loop.from, slot(from)), same.index_of(loop.to, slot(to)));
    }
  }
}

/// Into pieces of one size.
std::vector<MapTrack> cut(const std::vector<MapTrack>& tracks, std::size_t max_views) {
  constexpr std::size_t kMinViews = 3;
  std::vector<MapTrack> pieces;
  for (const MapTrack& track : tracks) {
    const std::size_t num_pieces = (track.size() + max_views - 1) / max_views;
    for (std::size_t i = 0; i < num_pieces && track.size() >= kMinViews; ++i) {
      const auto at = [&](std::size_t piece) {
        return track.begin() + static_cast<std::ptrdiff_t>(piece * track.size() / num_pieces);
      };
      pieces.emplace_back(at(i), at(i + 1));
    }
  }
  return pieces;
}

/// Far landmarks have the longest tracks and tell nothing of lengths: an order without a bias.
std::uint64_t hash_of(const MapTrack& track) {
  std::uint64_t mixed = static_cast<std::uint64_t>(track.front().keyframe) * 1'000'003U +
                        static_cast<std::uint64_t>(track.front().corner);
  mixed *= 0x9e3779b97f4a7c15U;
  mixed ^= mixed >> 31U;
  mixed *= 0xbf58476d1ce4e5b9U;
  return mixed >> 20U;
}

}  // namespace

std::vector<MapTrack> tracks_of(const KeptMap& map) {
  SameLandmark same(map);
  join_tracks(map, same);
  join_loops(map, same);
  std::vector<MapTrack> tracks;
  std::unordered_map<std::size_t, std::size_t> track_of;  // first corner -> track
  for (int i = 0; i < static_cast<int>(map.keyframes.size()); ++i) {
    const std::size_t num = map.keyframes[slot(i)].corners.size();
    for (std::size_t j = 0; j < num; ++j) {
      const auto [at, is_new] =
          track_of.try_emplace(same.first_of(same.index_of(i, j)), tracks.size());
      if (is_new) {
        tracks.emplace_back();
      }
      if (MapTrack& track = tracks[at->second]; track.empty() || track.back().keyframe != i) {
        track.push_back({i, static_cast<int>(j)});
      }
    }
  }
  std::erase_if(tracks, [](const MapTrack& track) { return track.size() < 2; });
  return tracks;
}

std::vector<MapTrack> choose_tracks(std::vector<MapTrack> tracks,
                                    std::size_t num_keyframes,
                                    std::size_t share,
                                    std::size_t max_views) {
  if (max_views > 0) {
    tracks = cut(tracks, max_views);
    std::ranges::stable_sort(tracks, {}, hash_of);
  } else {
    std::ranges::stable_sort(tracks, std::ranges::greater{}, &MapTrack::size);
  }
  std::vector<std::size_t> num(num_keyframes);
  std::erase_if(tracks, [&](const MapTrack& track) {
    const auto count = [&](const MapView& view) -> std::size_t& {
      return num[slot(view.keyframe)];
    };
    if (std::ranges::all_of(track, [&](const MapView& view) { return count(view) >= share; })) {
      return true;
    }
    std::ranges::for_each(track, [&](const MapView& view) { ++count(view); });
    return false;
  });
  return tracks;
}

}  // namespace stemvo
