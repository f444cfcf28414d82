// SPDX-License-Identifier: MIT
#include <string>

#include "support/kitti_clips.hpp"

namespace stemvo {
namespace {

class Kitti : public test::NeedsClips, public ::testing::WithParamInterface<std::string> {};

TEST_P(Kitti, StaysInsideTheThresholdsWithTrueSteps) {
  test::hold(test::run_stemvo, GetParam(), "ground_truth", "_true_steps.yaml", folder_ / "result");
}

TEST_P(Kitti, StaysInsideTheThresholdsFromTheCameraHeight) {
  test::hold(test::run_stemvo, GetParam(), "camera_height", "_camera_height.yaml",
             folder_ / "result");
}

INSTANTIATE_TEST_SUITE_P(Clips,
                         Kitti,
                         ::testing::Values("00", "02", "03", "06"),
                         [](const auto& clip) { return clip.param; });

}  // namespace
}  // namespace stemvo
