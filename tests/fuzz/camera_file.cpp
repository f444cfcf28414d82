// SPDX-License-Identifier: MIT
// Camera files of all kinds, and the lens that they describe.
#include "dataset/camera_file.hpp"

#include <cstdint>

#include "fuzz_input.hpp"
#include "odometry/frame_view.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  const auto read = dataset::read_camera_file(file.path());
  fuzz::expect_said(read);
  if (!read) {
    return 0;
  }
  const Camera& camera = read->camera;
  fuzz::expect(camera.width_px > 0 && camera.height_px > 0, "a camera has a size");
  fuzz::expect(camera.fx_px > 0.0 && camera.fy_px > 0.0, "focal lengths are positive");
  constexpr std::int64_t kMaxPixels = 1 << 16;  // larger ones take the fuzzer's time
  if (std::int64_t{camera.width_px} * camera.height_px <= kMaxPixels) {
    fuzz::expect_said(FrameView::create(read->camera));
  }
  return 0;
}
