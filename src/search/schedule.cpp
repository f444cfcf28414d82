// SPDX-License-Identifier: MIT
#include "search/schedule.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace stemvo::search {
namespace {

constexpr int kNumRungs = 5;
constexpr double kBudget = 0.25;
constexpr std::size_t kLeastFinalists = 2;
/// Powers tried, the slowest fall first.
constexpr double kLeastPower = 0.3;
constexpr double kMostPower = 3.0;
constexpr double kPowerStep = 0.05;

/// Of fewer filters an even fall would leave too few where the order begins to be known, at a
/// quarter of the frames: half go on to there, a sixth further, a twelfth to the end.
constexpr std::size_t kFewFilters = 16;
constexpr std::array<double, kNumRungs> kSharesOfFew = {1.0, 0.5, 0.5, 1.0 / 6.0, 1.0 / 12.0};

double frame_share(int rung) { return std::pow(2.0, rung - (kNumRungs - 1)); }

Schedule schedule_of_few(std::size_t num_filters) {
  Schedule schedule;
  for (int i = 0; i < kNumRungs; ++i) {
    const double count =
        static_cast<double>(num_filters) * kSharesOfFew[static_cast<std::size_t>(i)];
    schedule.push_back({frame_share(i), std::max(std::min<std::size_t>(1, num_filters),
                                                 static_cast<std::size_t>(std::lround(count)))});
  }
  return schedule;
}

Schedule schedule_of(std::size_t num_filters, double power) {
  Schedule schedule;
  for (int i = 0; i < kNumRungs; ++i) {
    const double growth = std::pow(2.0, i);
    const auto count = static_cast<std::size_t>(
        std::lround(static_cast<double>(num_filters) * std::pow(growth, -power)));
    const std::size_t most = schedule.empty() ? num_filters : schedule.back().num_filters;
    schedule.push_back({frame_share(i), std::min(most, std::max(count, kLeastFinalists))});
  }
  return schedule;
}

}  // namespace

Schedule halving_schedule(std::size_t num_filters) {
  if (num_filters < kFewFilters) {
    return schedule_of_few(num_filters);
  }
  double power = kLeastPower;
  while (power < kMostPower && cost_share(schedule_of(num_filters, power)) > kBudget) {
    power += kPowerStep;
  }
  return schedule_of(num_filters, power);
}

double cost_share(const Schedule& schedule) {
  double cost = 0.0;
  double before = 0.0;
  for (const Rung& rung : schedule) {
    cost += static_cast<double>(rung.num_filters) * (rung.frame_share - before);
    before = rung.frame_share;
  }
  return cost / static_cast<double>(schedule.front().num_filters);
}

std::size_t frames_at(const Rung& rung, std::size_t num_frames) {
  const auto frames =
      static_cast<std::size_t>(std::floor(rung.frame_share * static_cast<double>(num_frames)));
  return std::clamp<std::size_t>(frames, std::min<std::size_t>(2, num_frames), num_frames);
}

}  // namespace stemvo::search
