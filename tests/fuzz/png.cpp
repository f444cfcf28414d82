// SPDX-License-Identifier: MIT
// The PNG decoder against libpng: the same pixels, or it refuses.
#include "io/png.hpp"

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "fuzz_input.hpp"
#include "png_mutator.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const io::Bytes bytes(data, size);
  if (!io::is_png(bytes) || fuzz::is_large_png(bytes)) {
    return 0;  // a large one takes the fuzzer's time
  }
  for (const bool as_color : {false, true}) {
    const auto ours = io::decode_png(bytes, "image", as_color);
    fuzz::expect_said(ours);
    if (!ours) {
      continue;
    }
    const cv::Mat theirs = io::decode_any_png(bytes, as_color);
    fuzz::expect(!theirs.empty(), "libpng takes what we take");
    fuzz::expect(ours->size() == theirs.size() && ours->type() == theirs.type(),
                 "the image is of libpng's size and kind");
    fuzz::expect(cv::norm(*ours, theirs, cv::NORM_INF) == 0.0, "pixels are libpng's");
  }
  return 0;
}
