// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo {

/// A metrics.json and what it is held against; at least one of the two files.
struct CheckRequest {
  std::filesystem::path metrics;  ///< metrics.json of a run, or the run's folder
  std::optional<std::filesystem::path> thresholds;
  std::optional<std::filesystem::path> baseline;  ///< those of an earlier run
  double tolerance = 0.05;                        ///< share of the baseline's number
};

struct ThresholdResult {
  std::string key = {};  ///< dotted, e.g. "ate_rmse_m.none"
  bool is_max = true;    ///< whether `limit` is a maximum
  double limit = 0.0;
  std::string place = {};                       ///< the bound's: "FILE:LINE: " or "FILE: "
  std::optional<double> number = std::nullopt;  ///< as found; nullopt: null
  bool passed = false;
  std::string problem = {};  ///< the bound or the metric cannot be read: why; it did not pass
};

/// Thresholds are YAML: `t_rel_percent: {max: 1.0}`, nested keys dotted (`ate_rmse_m.none`); min
/// and max may stand together and are two results, in the file's order. A metric that is null
/// fails. A baseline bounds its own errors from above and tracked_fraction from below, by the
/// tolerance. Problems of one bound: other than min and max, not a finite number, a key the metrics
/// do not have, a metric that is not a number, a baseline of another recording, other frames or
/// another alignment. Errors: file missing, not JSON, not YAML, no thresholds.
[[nodiscard]] Expected<std::vector<ThresholdResult>> check_metrics(const CheckRequest& request);

[[nodiscard]] bool all_passed(const std::vector<ThresholdResult>& results);

[[nodiscard]] std::string format_check_table(const std::vector<ThresholdResult>& results);

/// JUnit's XML: a test case per bound; a problem is an error, a bound that was passed a failure.
[[nodiscard]] std::string format_junit(const std::vector<ThresholdResult>& results,
                                       const std::string& name);

}  // namespace stemvo
