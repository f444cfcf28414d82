// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string_view>
#include <vector>

namespace stemvo::benchmark {

/// What a publication reports for one whole sequence. Only numbers that were read in their source.
struct PublishedNumbers {
  std::string_view method;
  std::string_view scale;      ///< where its metres come from
  std::string_view alignment;  ///< what was fitted to the ground truth before it was judged
  std::optional<double> t_rel_percent;
  std::optional<double> r_rel_deg_per_100m;
  std::optional<double> average_offset_m;  ///< mean of |dx| + |dz|, the paper's Table 4
  std::optional<double> ate_rmse_m;
  std::string_view source;
};

/// Of the sequence `name` ("00" to "10"), the paper's Table 4 first; empty for any other name.
[[nodiscard]] std::vector<PublishedNumbers> published_numbers(std::string_view name);

}  // namespace stemvo::benchmark
