// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo {

/// One bound of a thresholds file, held against a metrics.json.
struct ThresholdResult {
  std::string key;     ///< dotted, e.g. "ate_rmse_m.none"
  bool is_max = true;  ///< whether `limit` is a maximum
  double limit = 0.0;
  int line = 0;                  ///< in the thresholds file
  std::optional<double> number;  ///< as found; nullopt: null
  bool passed = false;
};

/// Thresholds are YAML: `t_rel_percent: {max: 1.0}`, `tracked_fraction: {min: 0.99}`, nested keys
/// dotted (`ate_rmse_m.none: {max: 3}`); min and max may stand together and are two results, in the
/// file's order. A metric that is null fails. Errors (file, and line where there is one): file
/// missing, not JSON, not YAML, no thresholds, a bound other than min and max, a bound that is not
/// a finite number, a key the metrics do not have, a metric that is not a number.
[[nodiscard]] Expected<std::vector<ThresholdResult>> check_metrics(
    const std::filesystem::path& metrics_file, const std::filesystem::path& thresholds_file);

/// False when any bound was passed.
[[nodiscard]] bool all_passed(const std::vector<ThresholdResult>& results);

/// Aligned table, one line per bound and a summary line; ends with a newline.
[[nodiscard]] std::string format_check_table(const std::vector<ThresholdResult>& results);

}  // namespace stemvo
