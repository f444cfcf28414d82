// SPDX-License-Identifier: MIT
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "report/evaluate_report.hpp"
#include "support/drives.hpp"
#include "support/run_program.hpp"

namespace stemvo {
namespace {

using test::ProgramResult;
using test::run_stemvo;

using Runner = ProgramResult (*)(const std::vector<std::string>& arguments);

/// A real clip, held against tests/regression/thresholds/kitti_NN_PROTOCOL.yaml.
void hold(Runner run_by,
          const std::string& clip,
          const std::string& scale_source,
          const std::string& thresholds,
          const std::string& out) {
  const auto data = test::shared_data();
  const ProgramResult run = run_by({"run", (*data / "kitti/sequences" / clip).string(), "--out",
                                    out, "--set", "scale.source=" + scale_source});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const ProgramResult check =
      run_stemvo({"check", out + "/metrics.json", "--against",
                  STEMVO_SOURCE_DIR "/tests/regression/thresholds/kitti_" + clip + thresholds});
  EXPECT_EQ(check.exit_code, 0) << check.out << check.err;
  std::cout << run.out << check.out;
}

class NeedsClips : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!test::shared_data()) {
      GTEST_SKIP() << "STEMVO_SHARED_DATA is not set";
    }
  }
  test::TempFolder folder_;
};

class Kitti : public NeedsClips, public ::testing::WithParamInterface<std::string> {};

TEST_P(Kitti, StaysInsideTheThresholdsWithTrueSteps) {
  hold(run_stemvo, GetParam(), "ground_truth", "_true_steps.yaml", folder_ / "result");
}

TEST_P(Kitti, StaysInsideTheThresholdsFromTheCameraHeight) {
  hold(run_stemvo, GetParam(), "camera_height", "_camera_height.yaml", folder_ / "result");
}

/// Without AVX2: the same thresholds, and a path near the other one.
class KittiPortable : public NeedsClips {
 protected:
  void hold_both(const std::string& scale_source, const std::string& thresholds) {
    const std::string fast = folder_ / "fast";
    const std::string portable = folder_ / "portable";
    hold(run_stemvo, "03", scale_source, thresholds, fast);
    hold(test::run_stemvo_portable, "03", scale_source, thresholds, portable);
    const auto difference =
        evaluate_files({fast + "/trajectory_kitti.txt", {portable + "/trajectory_kitti.txt"}});
    ASSERT_TRUE(difference.has_value());
    const double found_m = difference->rows.front().metrics.ate_rmse.none_m;
    std::cout << "apart by " << found_m << " m (RMSE)\n";
    EXPECT_LE(found_m, 0.2);  // found: 0.05 and 0.07; harmless changes: 0.06 to 0.28
  }
};

TEST_F(KittiPortable, StaysInsideTheThresholdsWithTrueSteps) {
  hold_both("ground_truth", "_true_steps.yaml");
}

TEST_F(KittiPortable, StaysInsideTheThresholdsFromTheCameraHeight) {
  hold_both("camera_height", "_camera_height.yaml");
}

// Frames a second are measured by hand on an idle machine (docs/performance.md); held here, where
// machines are shared and their clocks vary, is the processor time of the whole program.
void expect_processor_ms_per_frame(const std::vector<std::string>& settings,
                                   const std::string& out,
                                   double bound_ms) {
  const auto data = test::shared_data();
  std::vector<std::string> arguments = {
      "run", (*data / "kitti/sequences/03").string(), "--out", out, "--frames", "0:200", "--quiet"};
  arguments.insert(arguments.end(), settings.begin(), settings.end());
  const ProgramResult run = run_stemvo(arguments);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const double found_ms = 1000.0 * run.cpu_s / 200;
  std::cout << found_ms << " ms of processor time per frame\n";
  EXPECT_LE(found_ms, bound_ms);
}

class KittiSpeed : public NeedsClips {
 protected:
  static double t_rel_percent(const std::string& out) {
    return nlohmann::json::parse(test::read_file(out + "/metrics.json")).at("t_rel_percent");
  }
};

// Found: 12 ms.
TEST_F(KittiSpeed, ProcessorTimePerFrameIsBounded) {
  expect_processor_ms_per_frame({}, folder_ / "result", 30.0);
}

// 7 to 8 ms.
TEST_F(KittiSpeed, ProcessorTimePerFrameOfPairsIsBounded) {
  expect_processor_ms_per_frame(
      {"--set", "odometry.mode=two_frame", "--set", "scale.source=constant_speed"},
      folder_ / "result", 20.0);
}

// 15 ms; t_rel of these frames at most 1.5 times the defaults'.
TEST_F(KittiSpeed, FastYamlIsCheaperAndNearlyAsAccurate) {
  const std::string whole = folder_ / "defaults";
  const std::string fast = folder_ / "fast";
  expect_processor_ms_per_frame({}, whole, 30.0);
  expect_processor_ms_per_frame(
      {"--threads", "1", "--config", STEMVO_SOURCE_DIR "/config/fast.yaml"}, fast, 20.0);
  EXPECT_LE(t_rel_percent(fast), 1.5 * t_rel_percent(whole));
}

INSTANTIATE_TEST_SUITE_P(Clips,
                         Kitti,
                         ::testing::Values("00", "02", "03", "06"),
                         [](const auto& clip) { return clip.param; });

}  // namespace
}  // namespace stemvo
