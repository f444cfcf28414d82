// SPDX-License-Identifier: MIT
#include <algorithm>

#include <fmt/format.h>

#include "report/text_table.hpp"
#include "search/ranking.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo {

std::string format_search_table(const SearchReport& report) {
  const auto cell = [](const std::optional<double>& value, int decimals) {
    return value ? fmt::format("{:.{}f}", *value, decimals) : std::string("-");
  };
  const bool has_held_out =
      std::any_of(report.rows.begin(), report.rows.end(),
                  [](const FilterRow& row) { return row.held_out.has_value(); });
  TextTable table("rllrlrrrrrrrrrl");
  table.add({"", "model", "layer", "filter", "by", "t_rel %", "r_rel deg/100m", "offset m", "E_t m",
             "E_r deg", "inliers", "tracked %", "frames", has_held_out ? "held out t_rel %" : "",
             ""});
  table.rule();
  int rank = 0;
  for (const FilterRow& row : report.rows) {
    const search::MeanScore mean = search::mean_score(row.drives);
    const bool is_ranked = row.status == FilterStatus::kRanked;
    const bool is_detected = row.status != FilterStatus::kNotDetected;
    std::string remark;
    if (!is_detected) {
      remark = "pose not detected: " + search::reason_of(row);
    } else if (!is_ranked) {
      remark = "stopped";
    }
    table.add(
        {is_ranked ? std::to_string(++rank) : "", row.key.model, row.key.layer,
         std::to_string(row.key.filter), row.key.features,
         cell(is_detected ? mean.t_rel_percent : std::nullopt, 3),
         cell(is_detected ? mean.r_rel_deg_per_100m : std::nullopt, 3),
         cell(mean.average_offset_m, 2), cell(mean.translation_change_m, 3),
         cell(mean.rotation_change_deg, 3), cell(mean.mean_inliers, 0),
         cell(mean.tracked_fraction ? std::optional(100.0 * *mean.tracked_fraction) : std::nullopt,
              1),
         std::to_string(mean.num_frames),
         row.held_out && row.held_out->is_detected ? cell(row.held_out->t_rel_percent, 3) : "",
         remark});
  }
  return table.str();
}

}  // namespace stemvo
