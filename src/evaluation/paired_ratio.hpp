// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace stemvo {

/// Errors of two methods on the same segments of one drive, in the order of the segments.
struct PairedErrors {
  std::vector<double> a;  ///< > 0
  std::vector<double> b;  ///< as many
  std::size_t block = 1;  ///< segments that are correlated: those that overlap
  std::string road = {};  ///< the same one: the same frames, disturbed; empty: of its own
};

/// How many times as large the errors of `a` are as those of `b`.
struct ErrorRatio {
  double ratio = 1.0;
  double low = 1.0;  ///< 95 % interval
  double high = 1.0;

  /// Else the two cannot be told apart.
  [[nodiscard]] bool is_decided() const { return high < 1.0 || low > 1.0; }
};

/// Ratio of the mean errors, its geometric mean over drives, and the 2.5th and 97.5th percentile of
/// 2000 moving-block bootstrap samples of each road (Kuensch 1989; circular: Politis and Romano
/// 1992), widened for overlapping segments and few blocks. Drives on one road share their blocks
/// and count as one; other drives are taken for independent. Those of fewer than two blocks are
/// left out; below four degrees of freedom (blocks less roads) the interval is everything.
[[nodiscard]] ErrorRatio paired_ratio(std::span<const PairedErrors> drives, std::uint64_t seed);

}  // namespace stemvo
