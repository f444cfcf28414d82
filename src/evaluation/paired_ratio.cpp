// SPDX-License-Identifier: MIT
#include "evaluation/paired_ratio.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <utility>

#include "internal_check.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kNumSamples = 2000;
constexpr double kTail = 0.025;
constexpr double kLeastError = 1e-9;  // below it a ratio is one of roundings

/// Running sums over twice the values: any circular block's sum is one subtraction.
std::vector<double> running_sums(const std::vector<double>& values) {
  std::vector<double> sums(2 * values.size() + 1, 0.0);
  for (std::size_t i = 0; i + 1 < sums.size(); ++i) {
    sums[i + 1] = sums[i] + values[i % values.size()];
  }
  return sums;
}

/// One drive, ready to be sampled.
class BlockSampler {
 public:
  explicit BlockSampler(const PairedErrors& errors)
      : a_(running_sums(errors.a)),
        b_(running_sums(errors.b)),
        size_(errors.a.size()),
        block_(std::clamp<std::size_t>(errors.block, 1, errors.a.size())) {
    STEMVO_CHECK(errors.a.size() == errors.b.size(), "the same segments");
  }

  [[nodiscard]] double log_ratio() const { return log_of(a_[size_], b_[size_]); }

  [[nodiscard]] double num_blocks() const {
    return static_cast<double>(size_) / static_cast<double>(block_);
  }

  [[nodiscard]] std::size_t num_draws() const { return (size_ + block_ - 1) / block_; }

  /// `starts`: of the blocks, shares of the drive; at least num_draws().
  [[nodiscard]] double draw(std::span<const double> starts) const {
    double a = 0.0;
    double b = 0.0;
    for (const double start : starts.first(num_draws())) {
      const auto first = static_cast<std::size_t>(start * static_cast<double>(size_));
      a += a_[first + block_] - a_[first];
      b += b_[first + block_] - b_[first];
    }
    return log_of(a, b);
  }

 private:
  static double log_of(double a, double b) {
    return std::log(std::max(a, kLeastError) / std::max(b, kLeastError));
  }

  std::vector<double> a_;
  std::vector<double> b_;
  std::size_t size_;
  std::size_t block_;
};

/// Drives that show the same frames.
struct Road {
  std::vector<BlockSampler> drives;
  double num_blocks = 0.0;  ///< of the drive with most
  std::size_t num_draws = 0;

  void add(const BlockSampler& drive) {
    num_blocks = std::max(num_blocks, drive.num_blocks());
    num_draws = std::max(num_draws, drive.num_draws());
    drives.push_back(drive);
  }
};

std::vector<Road> roads_of(std::span<const PairedErrors> drives) {
  std::map<std::string, Road> named;
  std::vector<Road> roads;
  for (const PairedErrors& drive : drives) {
    if (drive.a.size() < 2 * std::max<std::size_t>(drive.block, 1)) {
      continue;  // nothing to draw from
    }
    if (drive.road.empty()) {
      roads.emplace_back().add(BlockSampler(drive));
    } else {
      named[drive.road].add(BlockSampler(drive));
    }
  }
  for (auto& [name, road] : named) {
    roads.push_back(std::move(road));
  }
  return roads;
}

/// Geometric mean over all drives; `log_ratios_of`: the sum over a road's.
double mean_ratio(const std::vector<Road>& roads, const auto& log_ratios_of) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const Road& road : roads) {
    sum += log_ratios_of(road);
    count += road.drives.size();
  }
  return std::exp(sum / static_cast<double>(count));
}

double sum_over(const Road& road, const auto& log_ratio_of) {
  double sum = 0.0;
  for (const BlockSampler& drive : road.drives) {
    sum += log_ratio_of(drive);
  }
  return sum;
}

std::vector<double> sample_ratios(const std::vector<Road>& roads, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<double> starts;
  std::vector<double> ratios;
  for (std::size_t i = 0; i < kNumSamples; ++i) {
    ratios.push_back(mean_ratio(roads, [&](const Road& road) {
      starts.clear();
      for (std::size_t k = 0; k < road.num_draws; ++k) {
        starts.push_back(static_cast<double>(random() >> 11U) * 0x1p-53);  // [0, 1)
      }
      return sum_over(road, [&](const BlockSampler& drive) { return drive.draw(starts); });
    }));
  }
  std::ranges::sort(ratios);
  return ratios;
}

}  // namespace

ErrorRatio paired_ratio(std::span<const PairedErrors> drives, std::uint64_t seed) {
  constexpr double kLeastFreedom = 4.0;
  const std::vector<Road> roads = roads_of(drives);
  if (roads.empty()) {
    return {1.0, 0.0, std::numeric_limits<double>::infinity()};
  }
  const double ratio = mean_ratio(roads, [](const Road& road) {
    return sum_over(road, [](const BlockSampler& drive) { return drive.log_ratio(); });
  });
  double num_blocks = 0.0;
  for (const Road& road : roads) {
    num_blocks += road.num_blocks;
  }
  const double freedom = num_blocks - static_cast<double>(roads.size());
  if (freedom < kLeastFreedom) {
    return {ratio, 0.0, std::numeric_limits<double>::infinity()};
  }
  // Blocks as long as the overlap hold two thirds of the variance of a running mean's sum; a sample
  // of n blocks has (n - 1) / n of it; few of them need Student's quantile, here to 5 % of it.
  const double widen = std::sqrt(1.5 * num_blocks / freedom) * (1.0 + 1.5 / freedom);
  const std::vector<double> ratios = sample_ratios(roads, seed);
  const auto tail = static_cast<std::size_t>(kTail * kNumSamples);
  return {ratio, ratio * std::pow(ratios[tail] / ratio, widen),
          ratio * std::pow(ratios[kNumSamples - 1 - tail] / ratio, widen)};
}

}  // namespace stemvo
