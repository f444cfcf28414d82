// SPDX-License-Identifier: MIT
// metrics.json, read and written again.
#include "fuzz_input.hpp"
#include "report/metrics_json.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  const auto report = read_metrics_json(file.path());
  fuzz::expect_said(report);
  if (report) {
    (void)format_metrics_table(*report);
  }
  return 0;
}
