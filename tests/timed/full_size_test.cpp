// SPDX-License-Identifier: MIT
#include <string>

#include <gtest/gtest.h>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

TEST(RunFullSize, HundredRenderedFramesStayUnderTheLimit) {
  const TempFolder folder;
  const fs::path drive = test::rendered_drive({100, 1241, 376});
  const std::string out = folder / "result";
  const ProgramResult result = run_stemvo(
      {"run", drive / "sequences/00", "--out", out, "--set", "scale.source=ground_truth"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const ProgramResult check =
      run_stemvo({"check", out + "/metrics.json", "--against",
                  STEMVO_SOURCE_DIR "/tests/regression/thresholds/rendered.yaml"});
  EXPECT_EQ(check.exit_code, 0) << check.out << check.err;
}

}  // namespace
}  // namespace stemvo
