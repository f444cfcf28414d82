// SPDX-License-Identifier: MIT
#include "support/kitti_clips.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

class Kitti : public NeedsClips, public ::testing::WithParamInterface<std::string> {};

TEST_P(Kitti, StaysInsideTheThresholdsWithTrueSteps) {
  hold(GetParam(), "ground_truth", "_true_steps.yaml", folder_ / "result");
}

TEST_P(Kitti, StaysInsideTheThresholdsFromTheCameraHeight) {
  hold(GetParam(), "camera_height", "_camera_height.yaml", folder_ / "result");
}

INSTANTIATE_TEST_SUITE_P(Clips,
                         Kitti,
                         ::testing::Values("00", "02", "03", "06"),
                         [](const auto& clip) { return clip.param; });

}  // namespace
}  // namespace stemvo
