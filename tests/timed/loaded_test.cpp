// SPDX-License-Identifier: MIT
// Programs that take the processor from one another.
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

std::string results(const fs::path& out) {
  std::string bytes;
  for (const char* name :
       {"trajectory_kitti.txt", "trajectory_tum.txt", "trajectory_refined_kitti.txt",
        "trajectory_refined_tum.txt", "map.ply"}) {
    bytes += read_file(out / name);
  }
  return bytes;
}

TEST(Loaded, EightProgramsAtOnceAgree) {
  const TempFolder folder;
  const fs::path drive = test::rendered_drive() / "sequences/00";
  const auto arguments = [&](const std::string& out, int threads) {
    return std::vector<std::string>{
        "run",     drive.string(), "--out",     folder / out,
        "--quiet", "--map",        "--threads", std::to_string(threads)};
  };
  ASSERT_EQ(run_stemvo(arguments("alone", 2)).exit_code, 0);
  const std::string alone = results(folder / "alone");
  ASSERT_FALSE(alone.empty());
  const int threads[] = {1, 2, 4};
  for (int round = 0; round < 3; ++round) {
    std::vector<test::RunningProgram> programs;
    for (int i = 0; i < 8; ++i) {
      programs.emplace_back(STEMVO_PROGRAM, arguments(std::to_string(i), threads[(round + i) % 3]));
    }
    for (int i = 0; i < 8; ++i) {
      const ProgramResult result = programs[static_cast<std::size_t>(i)].wait();
      EXPECT_EQ(result.exit_code, 0) << result.err;
      EXPECT_TRUE(results(folder / std::to_string(i)) == alone)
          << threads[(round + i) % 3] << " threads";
    }
  }
}

}  // namespace
}  // namespace stemvo
