// SPDX-License-Identifier: MIT
#include "evaluation/paired_ratio.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

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

  [[nodiscard]] double draw(std::mt19937_64& random) const {
    double a = 0.0;
    double b = 0.0;
    for (std::size_t i = 0; i < (size_ + block_ - 1) / block_; ++i) {
      const std::size_t first = random() % size_;
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

}  // namespace

ErrorRatio paired_ratio(std::span<const PairedErrors> drives, std::uint64_t seed) {
  std::vector<BlockSampler> samplers;
  for (const PairedErrors& drive : drives) {
    if (!drive.a.empty()) {
      samplers.emplace_back(drive);
    }
  }
  if (samplers.empty()) {
    return {1.0, 0.0, std::numeric_limits<double>::infinity()};
  }
  const auto mean = [&](auto log_ratio_of) {
    double sum = 0.0;
    for (const BlockSampler& sampler : samplers) {
      sum += log_ratio_of(sampler);
    }
    return std::exp(sum / static_cast<double>(samplers.size()));
  };
  std::mt19937_64 random(seed);
  std::vector<double> ratios;
  for (std::size_t i = 0; i < kNumSamples; ++i) {
    ratios.push_back(mean([&](const BlockSampler& one) { return one.draw(random); }));
  }
  std::ranges::sort(ratios);
  double freedom = 0.0;
  for (const BlockSampler& sampler : samplers) {
    freedom += sampler.num_blocks() - 1.0;
  }
  const double ratio = mean([](const BlockSampler& one) { return one.log_ratio(); });
  if (freedom < 1.0) {
    return {ratio, 0.0, std::numeric_limits<double>::infinity()};
  }
  // Blocks as long as the overlap hold two thirds of the variance of a running mean's sum; few of
  // them need Student's quantile, here to 2 % of it from 4 degrees of freedom on.
  const double widen = std::sqrt(1.5) * (1.0 + 1.5 / freedom);
  const auto tail = static_cast<std::size_t>(kTail * kNumSamples);
  return {ratio, ratio * std::pow(ratios[tail] / ratio, widen),
          ratio * std::pow(ratios[kNumSamples - 1 - tail] / ratio, widen)};
}

}  // namespace stemvo
