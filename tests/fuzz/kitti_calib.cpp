// SPDX-License-Identifier: MIT
#include <cmath>

#include "dataset/frame_files.hpp"
#include "fuzz_input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  for (int index = 0; index < 4; ++index) {
    const auto camera = dataset::read_kitti_camera(file.path(), index);
    fuzz::expect_said(camera);
    if (!camera) {
      continue;
    }
    fuzz::expect(camera->fx_px >= 1.0 && camera->fy_px >= 1.0 && std::isfinite(camera->cx_px) &&
                     std::isfinite(camera->cy_px),
                 "a camera has positive focal lengths and a centre");
    Camera refined = *camera;
    refined.cx_px += 1.5;
    fuzz::expect_said(dataset::replace_kitti_camera(file.path(), *camera, refined));
  }
  return 0;
}
