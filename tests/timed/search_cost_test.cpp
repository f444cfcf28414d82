// SPDX-License-Identifier: MIT
#include <string>

#include <gmock/gmock.h>

#include "support/search_program.hpp"

namespace stemvo {
namespace {

/// Loose bound on a search's cost: a layer of 256 filters as wide as ConvNeXt-XL's stem, of frames
/// of KITTI's size.
class SearchCost : public Search {
 protected:
  /// Random filters with a layer norm; the path of the model.
  [[nodiscard]] std::string random_stem() const {
    const std::string root = STEMVO_SOURCE_DIR;
    const ProgramResult written =
        test::run_program(root + "/build/venv/bin/python",
                          {root + "/bench/random_stems.py", folder_.path().string()});
    EXPECT_EQ(written.exit_code, 0) << written.err;
    return folder_ / "full.onnx";
  }
};

TEST_F(SearchCost, Of256FiltersInOnePassIsBounded) {
  const fs::path drive =
      test::rendered_drive({.frames = 14, .width_px = 1241, .height_px = 376}) / "sequences/00";
  const ProgramResult result =
      run_stemvo({"search", drive.string(), "--model", random_stem(), "--exhaustive", "--quiet",
                  "--no-baselines", "--out", folder_ / "out"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  ASSERT_EQ(count_lines(folder_ / "out/filters.csv"), 257U);
  EXPECT_LE(result.peak_mib, 2048.0);
  EXPECT_GE(result.peak_mib, 300.0) << "the whole layer was not in flight";
  // 80 filter-frames per second on 2 cores are 25 ms of processor time each; found: 5 to 8 ms.
  EXPECT_LE(result.cpu_s / (256 * 14), 0.025);
}

}  // namespace
}  // namespace stemvo
