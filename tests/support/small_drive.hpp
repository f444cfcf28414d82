// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

#include <gtest/gtest.h>

#include "support/temp_folder.hpp"
#include "synth/synth.hpp"

namespace stemvo::testing {

/// A few small frames of a rendered street with ground truth, for tests inside one process.
class SmallDrive : public ::testing::Test {
 protected:
  static constexpr int kNumFrames = 24;

  SmallDrive() {
    const SyntheticDriveOptions options{.num_frames = kNumFrames, .width_px = 310, .height_px = 94};
    EXPECT_TRUE(render_synthetic_drive(folder_.path(), options));
  }

  TempFolder folder_;
  std::filesystem::path sequence_ = folder_.path() / "sequences/00";
};

}  // namespace stemvo::testing
