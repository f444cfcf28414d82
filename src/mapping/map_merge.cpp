// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <set>
#include <utility>

#include "mapping/kept_map.hpp"
#include "mapping/pose_graph.hpp"

namespace stemvo {
namespace {

/// Numbers change for so many merged keyframes at once.
constexpr int kMinMerged = 16;
/// A loop of fewer of a keyframe's corners says too little to stand for the keyframe.
constexpr double kMinShared = 0.2;

/// How a merged keyframe hangs on a place.
struct Hanging {
  MapEdge from_place;
  bool is_by_loop = false;
  bool is_recognized = false;  ///< directly
};

class Merge {
 public:
  Merge(KeptMap& map, int end) : map_(map), end_(end), hanging_(map.keyframes.size()) {}

  /// Decides which keyframes go; false: too few.
  bool plan() {
    motions_.resize(map_.keyframes.size());
    recognized_.resize(map_.keyframes.size());
    for (const MapEdge& motion : map_.motions) {
      if (motion.to == motion.from + 1 && !motion.is_guess()) {
        motions_[slot(motion.to)] = &motion;
      }
    }
    for (const Loop& loop : map_.loops) {
      const auto num_corners = map_.keyframes[slot(loop.to)].corners.size();
      if (static_cast<double>(loop.corners.size()) >
              kMinShared * static_cast<double>(num_corners) &&
          loop.from < loop.to && sigmas_off(map_, loop) < kMaxTakenInSigmas) {
        recognized_[slot(loop.to)] = &loop;
      }
    }
    int begin = -1;
    for (int node = 1; node < end_; ++node) {
      begin = motions_[slot(node)] == nullptr ? -1 : begin;
      if (recognized_[slot(node)] != nullptr) {
        if (begin >= 0) {
          plan_stretch(begin, node);
        }
        begin = node;
      } else if (is_place(node)) {
        begin = -1;
      }
    }
    return num_merged_ >= kMinMerged;
  }

  std::vector<int> apply() {
    rehang_edges();
    record_poses();
    return renumber();
  }

 private:
  /// `begin` and `end` were recognized.
  void plan_stretch(int begin, int end) {
    std::optional<Hanging> last;
    if (!is_place(begin)) {
      last = {*recognized_[slot(begin)], true, true};
      hanging_[slot(begin)] = last;
    }
    for (int node = begin + 1; node < end; ++node) {
      const MapEdge& motion = *motions_[slot(node)];
      last = Hanging{last ? chained(last->from_place, motion) : motion, last && last->is_by_loop};
      hanging_[slot(node)] = last;
    }
    num_merged_ += end - begin - (is_place(begin) ? 1 : 0);
  }

  [[nodiscard]] bool is_place(int node) const {
    return !map_.keyframes[slot(node)].descriptors.empty();
  }

  /// Edges of what goes go on from the place it hangs on. Between two places the first one counts:
  /// more of the same kind know no more.
  void rehang_edges() {
    std::set<std::pair<int, int>> place_pairs;
    const auto is_new = [&](const MapEdge& edge) {
      return !is_place(edge.from) || !is_place(edge.to) ||
             place_pairs.insert(std::minmax(edge.from, edge.to)).second;
    };
    std::vector<MapEdge> motions;
    std::vector<Loop> loops;
    const auto rehang = [&](const MapEdge& edge, const Loop* loop) {
      const auto& from = hanging_[slot(edge.from)];
      const auto& to = hanging_[slot(edge.to)];
      if (!from && !to) {
        (void)is_new(edge);
        if (loop != nullptr) {
          loops.push_back(*loop);
        } else {
          motions.push_back(edge);
        }
        return;
      }
      MapEdge moved = from ? chained(from->from_place, edge) : edge;
      moved = to ? chained(moved, reversed(to->from_place)) : moved;
      if (moved.from == moved.to || !is_new(moved)) {
        return;
      }
      if (loop != nullptr || (from && from->is_by_loop) || (to && to->is_by_loop)) {
        loops.push_back({moved, {}});
      } else {
        motions.push_back(moved);
      }
    };
    std::ranges::for_each(map_.motions, [&](const MapEdge& edge) { rehang(edge, nullptr); });
    std::ranges::for_each(map_.loops, [&](const Loop& loop) { rehang(loop, &loop); });
    map_.motions = std::move(motions);
    map_.loops = std::move(loops);
  }

  void record_poses() {
    for (std::size_t i = 0; i < hanging_.size(); ++i) {
      if (!hanging_[i]) {
        continue;
      }
      const KeptKeyframe& keyframe = map_.keyframes[i];
      const int place = hanging_[i]->from_place.from;
      map_.merged.push_back({keyframe.frame, keyframe.world_from_camera, place,
                             map_.pose(place).inverse() * map_.map_from_keyframe[i],
                             hanging_[i]->is_recognized});
    }
    std::ranges::sort(map_.merged, {}, &MergedKeyframe::frame);
  }

  std::vector<int> renumber() {
    std::vector<int> numbers;
    int next = 0;
    for (std::size_t i = 0; i < hanging_.size(); ++i) {
      numbers.push_back(hanging_[i] ? -1 : next);
      if (!hanging_[i]) {
        if (slot(next) != i) {
          map_.keyframes[slot(next)] = std::move(map_.keyframes[i]);
          map_.map_from_keyframe[slot(next)] = map_.map_from_keyframe[i];
        }
        ++next;
      }
    }
    map_.keyframes.resize(slot(next));
    map_.map_from_keyframe.resize(slot(next));
    const auto renumber_edge = [&](MapEdge& edge) {
      edge.from = numbers[slot(edge.from)];
      edge.to = numbers[slot(edge.to)];
    };
    std::ranges::for_each(map_.motions, renumber_edge);
    std::ranges::for_each(map_.loops, renumber_edge);
    for (MapLength& length : map_.lengths) {
      length.keyframe = numbers[slot(length.keyframe)];
    }
    std::erase_if(map_.lengths, [](const MapLength& length) { return length.keyframe < 0; });
    for (MergedKeyframe& merged : map_.merged) {
      merged.keyframe = numbers[slot(merged.keyframe)];
    }
    return numbers;
  }

  KeptMap& map_;
  int end_;
  std::vector<std::optional<Hanging>> hanging_;  ///< of each keyframe that goes
  std::vector<const MapEdge*> motions_;          ///< of each keyframe: from the one before
  std::vector<const Loop*> recognized_;
  int num_merged_ = 0;
};

}  // namespace

MapEdge chained(const MapEdge& a, const MapEdge& b) {
  const double arm = a.from_to.scale * b.from_to.translation.norm();
  const double shift = std::hypot(a.sigma_translation, a.from_to.scale * b.sigma_translation);
  return {.from = a.from,
          .to = b.to,
          .from_to = a.from_to * b.from_to,
          .sigma_rad = std::hypot(a.sigma_rad, b.sigma_rad),
          .sigma_translation = std::hypot(shift, arm * std::hypot(a.sigma_rad, a.sigma_log_scale)),
          .sigma_log_scale = std::hypot(a.sigma_log_scale, b.sigma_log_scale)};
}

MapEdge reversed(const MapEdge& edge) {
  MapEdge back = edge;
  std::swap(back.from, back.to);
  back.from_to = edge.from_to.inverse();
  const double arm = edge.from_to.translation.norm();
  back.sigma_translation =
      std::hypot(edge.sigma_translation, arm * edge.sigma_rad, arm * edge.sigma_log_scale) /
      edge.from_to.scale;
  return back;
}

std::vector<int> merge_known_terrain(KeptMap& map, int end) {
  Merge merge(map, end);
  return merge.plan() ? merge.apply() : std::vector<int>();
}

}  // namespace stemvo
