// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

TEST(SameBytes, TwoRunsAndAnyNumberOfThreadsGiveTheSameBytes) {
  const TempFolder folder;
  const std::string sequence = test::rendered_drive() / "sequences/00";
  std::vector<std::vector<std::string>> variants = {{}};
  for (int round = 0; round < 5; ++round) {
    for (const char* threads : {"1", "2", "4"}) {
      variants.push_back({"--threads", threads});
    }
  }
  std::string first;
  for (std::size_t i = 0; i < variants.size(); ++i) {
    const std::string out = folder / std::to_string(i);
    variants[i].insert(variants[i].begin(), {"run", sequence, "--out", out});
    ASSERT_EQ(run_stemvo(variants[i]).exit_code, 0);
    const std::string bytes =
        read_file(out + "/trajectory_kitti.txt") + read_file(out + "/trajectory_tum.txt");
    first = i == 0 ? bytes : first;
    EXPECT_FALSE(bytes.empty());
    EXPECT_TRUE(bytes == first) << "variant " << i;
  }
}

}  // namespace
}  // namespace stemvo
