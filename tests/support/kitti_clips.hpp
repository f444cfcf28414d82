// SPDX-License-Identifier: MIT
#pragma once

#include "support/program_test.hpp"
#include "support/shared_data.hpp"
#include "support/test.hpp"

namespace stemvo::test {

/// A real clip, held against tests/regression/thresholds/kitti_NN_PROTOCOL.yaml.
inline void hold(const std::string& clip,
                 const std::string& scale_source,
                 const std::string& thresholds,
                 const std::string& out) {
  const ProgramResult run =
      succeeded(run_stemvo({"run", (shared_data() / "kitti/sequences" / clip).string(), "--out",
                            out, "--set", "scale.source=" + scale_source}));
  const ProgramResult check =
      run_stemvo({"check", out + "/metrics.json", "--against",
                  STEMVO_SOURCE_DIR "/tests/regression/thresholds/kitti_" + clip + thresholds});
  EXPECT_EQ(check.exit_code, 0) << check.out << check.err;
  std::cout << run.out << check.out;
}

class NeedsClips : public ::testing::Test {
 protected:
  void SetUp() override { STEMVO_NEEDS_SHARED_DATA(); }
  TempFolder folder_;
};

}  // namespace stemvo::test
