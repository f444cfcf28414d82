// SPDX-License-Identifier: MIT
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

TEST(SameBytes, TwoRunsAndAnyNumberOfThreadsGiveTheSameBytes) {
  const TempFolder folder;
  const std::string sequence = rendered_drive() / "sequences/00";
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
    succeeded(run_stemvo(variants[i]));
    const std::string bytes =
        read_file(out + "/trajectory_kitti.txt") + read_file(out + "/trajectory_tum.txt");
    first = i == 0 ? bytes : first;
    EXPECT_FALSE(bytes.empty());
    EXPECT_TRUE(bytes == first) << "variant " << i;
  }
}

}  // namespace
}  // namespace stemvo
