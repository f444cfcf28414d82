// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "search/record_file.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

/// Means over the sequences that rank; nullopt where one of them has none.
struct MeanScore {
  std::optional<double> t_rel_percent;
  std::optional<double> r_rel_deg_per_100m;
  std::optional<double> average_offset_m;
  std::optional<double> translation_change_m;
  std::optional<double> rotation_change_deg;
  std::optional<double> mean_inliers;
  std::optional<double> tracked_fraction;
  std::optional<double> early_error_percent;
  std::size_t num_frames = 0;  ///< of all of them together
};
[[nodiscard]] MeanScore mean_score(const std::vector<DriveScore>& drives);

/// Why a pose was not detected: of the first sequence that the filter failed on; else empty.
[[nodiscard]] std::string reason_of(const FilterRow& row);

/// By model, layer, features and filter: what decides where numbers do not.
[[nodiscard]] bool comes_before(const FilterKey& a, const FilterKey& b);
/// The same, of maps and sets.
struct KeyOrder {
  bool operator()(const FilterKey& a, const FilterKey& b) const { return comes_before(a, b); }
};

/// One row per filter from its last rung, ranked: by t_rel, ties by r_rel; then those that were
/// stopped, the later the better; not detected last. Does not depend on the records' order.
[[nodiscard]] std::vector<FilterRow> rank_filters(std::span<const Record> records,
                                                  std::size_t num_rungs);

/// Of records of one rung, those that go on: the `count` best by their early errors, near ties by
/// inliers. Of filters with the same numbers (R, G and B of a gray sequence) one goes on, the
/// others where there is room.
[[nodiscard]] std::vector<FilterKey> choose_survivors(const std::vector<const Record*>& records,
                                                      std::size_t count);

}  // namespace stemvo::search
