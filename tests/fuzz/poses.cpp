// SPDX-License-Identifier: MIT
// Poses in the formats of KITTI, TUM and EuRoC.
#include <algorithm>

#include "evaluation/trajectory.hpp"
#include "fuzz_input.hpp"

namespace {

bool is_pose(const stemvo::Rigid3& pose) { return pose.matrix().allFinite(); }

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  const auto poses = read_pose_file(file.path());
  fuzz::expect_said(poses);
  if (poses) {
    fuzz::expect(!poses->poses.empty(), "there is a pose");
    fuzz::expect(std::ranges::all_of(poses->poses, is_pose), "poses are finite");
    fuzz::expect(poses->timestamps_s.empty() || poses->timestamps_s.size() == poses->poses.size(),
                 "a time for each pose, or none");
    fuzz::expect(std::ranges::is_sorted(poses->timestamps_s), "poses are in order");
    const Trajectory moved = relative_to_first(poses->poses);
    fuzz::expect(std::ranges::all_of(moved, is_pose), "poses stay finite when moved");
  }
  fuzz::expect_said(read_kitti_trajectory(file.path()));
  return 0;
}
