// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include "dataset/frame_files.hpp"
#include "fuzz_input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  const auto times = dataset::read_kitti_times(file.path(), 2);
  fuzz::expect_said(times);
  if (times) {
    const auto* times_s = &times->rows;
    fuzz::expect(times_s->size() >= 2, "as many times as asked for");
    fuzz::expect(std::ranges::all_of(*times_s, [](double time) { return std::isfinite(time); }) &&
                     std::ranges::is_sorted(*times_s),
                 "times are finite and increase");
  }
  return 0;
}
