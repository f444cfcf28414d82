// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "search/race.hpp"

namespace stemvo::search {
namespace {

constexpr double kBudget = 0.25;
/// Of fewer filters an even fall would leave too few where the order begins to be known, at a
/// quarter of the frames.
constexpr std::size_t kFewFilters = 16;

using Shares = std::array<double, 5>;
constexpr Shares kFrameShares = {1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0, 1.0};

/// `shares` of the filters go on to each rung, at least `min_filters`.
Schedule schedule_of(std::size_t num_filters, const Shares& shares, std::size_t min_filters) {
  Schedule schedule;
  std::size_t max_filters = num_filters;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const auto count =
        static_cast<std::size_t>(std::lround(static_cast<double>(num_filters) * shares[i]));
    max_filters = std::min(max_filters, std::max(count, min_filters));
    schedule.push_back({kFrameShares[i], max_filters});
  }
  return schedule;
}

/// What a mean is taken of.
constexpr std::optional<double> DriveScore::* kNumbers[] = {
    &DriveScore::t_rel_percent,    &DriveScore::r_rel_deg_per_100m,
    &DriveScore::average_offset_m, &DriveScore::E_t_m,
    &DriveScore::E_r_deg,          &DriveScore::inliers,
    &DriveScore::tracked,          &DriveScore::early_error_percent};

constexpr double kWorst = std::numeric_limits<double>::infinity();
/// Early on filters differ by less than chance; then more inliers are better: 10 % more weigh like
/// 0.5 % of error (docs/search.md).
constexpr double kInlierPower = 0.05;

/// What unfinished filters are compared by.
double early_error(const DriveScore& mean) {
  const double inliers = std::max(1.0, mean.inliers.value_or(1.0));
  return mean.early_error_percent.value_or(kWorst) * std::pow(inliers, -kInlierPower);
}

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

/// What survivors are chosen by: first detected or not and the early error; the other numbers tell
/// whether two filters are one.
std::tuple<int, double, double, double, double> standing_of(const FilterRecord& record) {
  const DriveScore mean = mean_score(record.drives);
  return {mean.detected ? 0 : 1, early_error(mean), mean.E_r_deg.value_or(kWorst),
          mean.average_offset_m.value_or(kWorst), mean.inliers.value_or(0.0)};
}

}  // namespace

Schedule halving_schedule(std::size_t num_filters) {
  if (num_filters < kFewFilters) {
    return schedule_of(num_filters, {1.0, 0.5, 0.5, 1.0 / 6.0, 1.0 / 12.0}, 1);
  }
  Schedule schedule;
  double power = 0.3;
  do {  // the slowest fall first
    Shares shares{};
    for (std::size_t i = 0; i < shares.size(); ++i) {
      shares[i] = std::pow(kFrameShares[i] / kFrameShares[0], -power);
    }
    schedule = schedule_of(num_filters, shares, 2);
    power += 0.05;
  } while (cost_share(schedule) > kBudget && power < 3.0);
  return schedule;
}

double cost_share(const Schedule& schedule) {
  double cost = 0.0;
  double before = 0.0;
  for (const Rung& rung : schedule) {
    cost += static_cast<double>(rung.filters) * (rung.frame_share - before);
    before = rung.frame_share;
  }
  return cost / static_cast<double>(schedule.front().filters);
}

std::size_t frames_at(const Rung& rung, std::size_t num_frames) {
  const auto frames =
      static_cast<std::size_t>(std::floor(rung.frame_share * static_cast<double>(num_frames)));
  return std::clamp<std::size_t>(frames, std::min<std::size_t>(2, num_frames), num_frames);
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

std::vector<FilterRow> rank_filters(const FilterRecords& records, std::size_t num_rungs) {
  std::map<FilterKey, FilterRow> last;
  for (const FilterRecord& record : records) {
    last[record.key] = {record, {}, mean_score(record.drives)};
  }
  std::vector<FilterRow> rows;
  for (auto& [key, row] : last) {
    row.status = !row.mean.detected         ? FilterStatus::kNotDetected
                 : row.rung + 1 < num_rungs ? FilterStatus::kStopped
                                            : FilterStatus::kRanked;
    rows.push_back(std::move(row));
  }
  std::ranges::stable_sort(rows, {}, order_of);
  return rows;
}

std::vector<std::size_t> best_first(std::span<const FilterRecord* const> records) {
  // What gives the same numbers to the last bit is the same channel: one of them tells all.
  std::map<decltype(standing_of({})), std::map<FilterKey, std::size_t>> channels;
  for (std::size_t i = 0; i < records.size(); ++i) {
    channels[standing_of(*records[i])].emplace(records[i]->key, i);
  }
  std::vector<std::size_t> order;
  std::vector<std::size_t> repeated;
  for (const auto& [standing, filters] : channels) {
    for (const auto& [key, index] : filters) {
      (key == filters.begin()->first ? order : repeated).push_back(index);
    }
  }
  order.insert(order.end(), repeated.begin(), repeated.end());
  return order;
}

}  // namespace stemvo::search
