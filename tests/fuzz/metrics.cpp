// SPDX-License-Identifier: MIT
// metrics.json, held against thresholds.
#include <string_view>

#include "fuzz_input.hpp"
#include "report/check.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  constexpr std::string_view kThresholds = "frames: {min: 1}\nate_rmse_m.none: {max: 1.5}\n";
  const fuzz::InputFile thresholds(reinterpret_cast<const std::uint8_t*>(kThresholds.data()),
                                   kThresholds.size());
  const fuzz::InputFile metrics(data, size);
  const auto results = check_metrics({metrics.path(), thresholds.path(), std::nullopt});
  fuzz::expect_said(results);
  if (results) {
    fuzz::expect(results->size() == 2 && !format_check_table(*results).empty(), "a row per bound");
  }
  return 0;
}
