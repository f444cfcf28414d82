// SPDX-License-Identifier: MIT
#pragma once

#include <iostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "support/drives.hpp"
#include "support/run_program.hpp"
#include "support/shared_data.hpp"

namespace stemvo::test {

using Runner = ProgramResult (*)(const std::vector<std::string>& arguments);

/// A real clip, held against tests/regression/thresholds/kitti_NN_PROTOCOL.yaml.
inline void hold(Runner run_by,
                 const std::string& clip,
                 const std::string& scale_source,
                 const std::string& thresholds,
                 const std::string& out) {
  const ProgramResult run =
      run_by({"run", (testing::shared_data() / "kitti/sequences" / clip).string(), "--out", out,
              "--set", "scale.source=" + scale_source});
  ASSERT_EQ(run.exit_code, 0) << run.err;
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
