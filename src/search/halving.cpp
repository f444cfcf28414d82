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
/// With fewer filters an even fall would leave too few where the order begins to be known, at a
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

constexpr double kNone = std::numeric_limits<double>::infinity();

/// Order by which survivors are chosen: first detected or not and the early error; the other
/// numbers tell whether two filters are one.
std::tuple<int, double, double, double, double> standing_of(const FilterRecord& record) {
  const DriveScore mean = mean_score(record.drives);
  return {mean.detected ? 0 : 1, early_error(mean), mean.E_r_deg.value_or(kNone),
          mean.average_offset_m.value_or(kNone), mean.inliers.value_or(0.0)};
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

std::vector<std::size_t> best_first(std::span<const FilterRecord* const> records) {
  // Filters with the same numbers to the last bit are the same channel: one of them tells all.
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
