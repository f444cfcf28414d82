// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mapping/kept_map.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// A place that looks like a frame.
struct PlaceCandidate {
  int keyframe = 0;    ///< its number in the map
  double votes = 0.0;  ///< of the frame's descriptors
};

/// Finds places by their descriptors: tables of bits, in which two descriptors meet when a table's
/// bits of theirs are the same (locality-sensitive hashing; Indyk and Motwani 1998).
class PlaceIndex {
 public:
  PlaceIndex();

  /// `keyframe`: its number in the map, higher than those before.
  void add(int keyframe, std::span<const Descriptor> descriptors);
  /// Keyframes have new numbers: that of each old one.
  void renumber(std::span<const int> numbers) {
    for (int& keyframe : keyframes_) {
      keyframe = numbers[static_cast<std::size_t>(keyframe)];
    }
  }
  /// The places among those that `may_be` says by their number with the most votes, at most so
  /// many, best first.
  [[nodiscard]] std::vector<PlaceCandidate> candidates(
      std::span<const Descriptor> descriptors,
      const std::function<bool(int keyframe)>& may_be,
      int max_candidates) const;

 private:
  static constexpr int kTables = 6;
  static constexpr int kBits = 14;  ///< of a cell's number
  struct Entry {
    Descriptor descriptor;
    std::uint32_t place;  ///< index into keyframes_
  };
  using Cell = std::vector<std::uint32_t>;  ///< indices into entries_

  struct Votes {
    double num = 0.0;
    int last_by = -1;  ///< number of a descriptor
    bool counts = true;
  };
  static void vote(const PlaceIndex& index,
                   std::span<const Descriptor> descriptors,
                   std::vector<Votes>& votes);
  [[nodiscard]] std::uint32_t cell_of(const Descriptor& descriptor, int table) const {
    std::uint32_t cell = 0;
    for (const std::uint8_t bit : bits_[static_cast<std::size_t>(table)]) {
      cell = 2 * cell + static_cast<std::uint32_t>(descriptor[bit / 64U] >> (bit % 64U) & 1U);
    }
    return cell;
  }

  std::array<std::array<std::uint8_t, kBits>, kTables> bits_;  ///< the tables' bits
  std::array<std::vector<Cell>, kTables> tables_;
  std::vector<Entry> entries_;
  std::vector<int> keyframes_;
};

/// How many landmarks of one keyframe lie in the image of another one.
[[nodiscard]] int num_in_view(const KeptKeyframe& of,
                              const KeptKeyframe& by,
                              const Similarity3& by_from_of);

/// A place that a keyframe shows in part, if both are where the map has them.
struct ExpectedView {
  int place = 0;  ///< number of its keyframe
  Similarity3 keyframe_from_place;
  double share = 0.0;          ///< of the landmarks of either one that the other one sees
  double magnification = 1.0;  ///< of the keyframe's view to the place's
};

/// Picks the `places` that share enough of the view with a keyframe that is at `map_from_keyframe`.
/// The most first.
[[nodiscard]] std::vector<ExpectedView> expected_views(const KeptMap& map,
                                                       std::span<const int> places,
                                                       const Similarity3& map_from_keyframe,
                                                       const KeptKeyframe& keyframe);

}  // namespace stemvo
