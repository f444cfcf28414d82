// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <span>
#include <tuple>

#include "search/records.hpp"

namespace stemvo::search {
namespace {

/// Numbers of a score that a mean is taken of.
constexpr std::optional<double> DriveScore::* kNumbers[] = {
    &DriveScore::t_rel_percent,    &DriveScore::r_rel_deg_per_100m,
    &DriveScore::average_offset_m, &DriveScore::E_t_m,
    &DriveScore::E_r_deg,          &DriveScore::inliers,
    &DriveScore::tracked,          &DriveScore::early_error_percent};

constexpr double kWorst = std::numeric_limits<double>::infinity();
/// Early on filters differ by less than chance; then more inliers are better: 10 % more weigh like
/// 0.5 % of error (docs/search.md).
constexpr double kInlierPower = 0.05;

/// Smaller is better, number by number.
std::tuple<FilterStatus, double, double> order_of(const FilterRow& row) {
  if (row.status == FilterStatus::kRanked) {
    return {row.status, row.mean.t_rel_percent.value_or(kWorst),
            row.mean.r_rel_deg_per_100m.value_or(kWorst)};
  }
  const bool is_stopped = row.status == FilterStatus::kStopped;
  return {row.status, is_stopped ? -static_cast<double>(row.rung) : 0.0,
          is_stopped ? early_error(row.mean) : 0.0};
}

/// Mean of the dense errors, as paired_ratio has them; of t_rel where the path is too short for
/// them.
double mean_error_percent(const DriveScore& drive) {
  const std::vector<double>& dense = drive.dense_t_percent;
  return dense.empty()
             ? drive.t_rel_percent.value_or(kWorst)
             : std::accumulate(dense.begin(), dense.end(), 0.0) / static_cast<double>(dense.size());
}

/// Over the drives: none counts for more because it is hard.
double log_geometric_mean(const FilterRow& row) {
  constexpr double kLeast_percent = 1e-6;
  double sum = 0.0;
  for (const DriveScore& drive : row.drives) {
    sum += std::log(std::max(mean_error_percent(drive), kLeast_percent));
  }
  return sum;
}

/// Against the row with the lowest geometric mean.
void compare_with_best(const SearchIdentity& identity, std::span<FilterRow> ranked) {
  const FilterRow& best = *std::ranges::min_element(ranked, {}, log_geometric_mean);
  for (FilterRow& row : ranked) {
    std::vector<PairedErrors> drives;
    for (std::size_t i = 0; i < row.drives.size(); ++i) {
      const DriveScore& ours = row.drives[i];
      const DriveScore& theirs = best.drives[i];
      if (ours.dense_t_percent.size() == theirs.dense_t_percent.size()) {
        drives.push_back({ours.dense_t_percent, theirs.dense_t_percent, theirs.block,
                          identity.road_of(ours.sequence)});
      }
    }
    row.over_best = paired_ratio(drives, 1);
    row.is_equal = !(row.over_best.low > 1.0);
  }
}

}  // namespace

double early_error(const DriveScore& mean) {
  const double inliers = std::max(1.0, mean.inliers.value_or(1.0));
  return mean.early_error_percent.value_or(kWorst) * std::pow(inliers, -kInlierPower);
}

DriveScore mean_score(const std::vector<DriveScore>& drives) {
  DriveScore mean;
  mean.detected = true;
  const auto count = static_cast<double>(drives.size());
  for (const auto number : kNumbers) {
    mean.*number = 0.0;
    for (const DriveScore& drive : drives) {
      const bool is_known = mean.*number && drive.*number;
      mean.*number =
          is_known ? std::optional(*(mean.*number) + *(drive.*number) / count) : std::nullopt;
    }
  }
  for (const DriveScore& drive : drives) {
    mean.frames += drive.frames;
    if (mean.detected && !drive.detected) {
      mean.detected = false;
      mean.reason = (drives.size() > 1 ? drive.sequence + ": " : "") + drive.reason;
    }
  }
  return mean;
}

std::vector<FilterRow> rank_filters(const SearchIdentity& identity, const FilterRecords& records) {
  std::map<FilterKey, FilterRow> last;
  for (const FilterRecord& record : records) {
    FilterRow& row = last[record.key];
    static_cast<FilterRecord&>(row) = record;
    row.mean = mean_score(record.drives);
  }
  std::vector<FilterRow> rows;
  for (auto& [key, row] : last) {
    row.status = !row.mean.detected                     ? FilterStatus::kNotDetected
                 : row.rung + 1 < identity.rungs.size() ? FilterStatus::kStopped
                                                        : FilterStatus::kRanked;
    rows.push_back(std::move(row));
  }
  std::ranges::stable_sort(rows, {}, order_of);
  const auto num_ranked = std::ranges::count(rows, FilterStatus::kRanked, &FilterRow::status);
  const auto ranked = std::span(rows).first(static_cast<std::size_t>(num_ranked));
  if (!ranked.empty()) {
    compare_with_best(identity, ranked);
    std::ranges::stable_sort(ranked, {}, [](const FilterRow& row) {
      return std::pair(!row.is_equal, row.is_equal ? row.over_best.ratio : 0.0);
    });
  }
  return rows;
}

bool has_intervals(const std::vector<FilterRow>& rows) {
  return std::ranges::any_of(rows, [](const FilterRow& row) {
    return row.status == FilterStatus::kRanked && std::isfinite(row.over_best.high);
  });
}

}  // namespace stemvo::search
