// SPDX-License-Identifier: MIT
#include "evaluation/trajectory.hpp"
#include "support/kitti_clips.hpp"
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Speeds of the true path with 2 % of noise in each, in place of a road.
class Speeds : public ::testing::Test {
 protected:
  /// t_rel in percent without alignment; `sequence` has poses in ../../poses.
  double t_rel_with(const fs::path& sequence, double bias, const Words& more = {}) {
    const auto poses =
        read_kitti_trajectory(sequence / "../../poses" / (sequence.filename().string() + ".txt"));
    std::ifstream times(sequence / "times.txt");
    std::mt19937_64 engine(3);
    std::normal_distribution<double> noise(1.0 + bias, 0.02);
    std::string rows = "# s, m/s, 1-sigma\n";
    double last_s = 0.0;
    double time_s = 0.0;
    for (std::size_t i = 0; i < poses->size() && times >> time_s; last_s = time_s, ++i) {
      if (i > 0) {  // of the step, in its middle
        const double step_m = ((*poses)[i].translation - (*poses)[i - 1].translation).norm();
        const double speed = step_m / (time_s - last_s);
        rows += fmt::format("{:.6f}, {:.6f}, {:.6f}\n", 0.5 * (last_s + time_s),
                            speed * noise(engine), std::max(0.01, 0.02 * speed));
      }
    }
    write_file(folder_ / "speeds.csv", rows);
    const ProgramResult run =
        succeeded(run_stemvo({"run", sequence.string(), "--out", folder_ / "out", "--set",
                              "scale.source=none", "--speed", folder_ / "speeds.csv"},
                             more));
    EXPECT_THAT(run.err, HasSubstr(fmt::format(", {} speeds", poses->size() - 1)));
    const auto metrics = metrics_of(folder_ / "out");
    EXPECT_EQ(metrics.at("scale_source"), "speed");
    EXPECT_EQ(metrics.at("alignment"), "none");
    return metrics.at("t_rel_percent").get<double>();
  }
  TempFolder folder_;
};

TEST_F(Speeds, MakeMetresOfAClipWithoutItsRoad) {
  STEMVO_NEEDS_SHARED_DATA();
  const fs::path sequence = shared_data() / "kitti/sequences/03";
  EXPECT_LE(t_rel_with(sequence, 0.0), 0.6);
  const double biased = t_rel_with(sequence, 0.05);
  EXPECT_GE(biased, 4.4);
  EXPECT_LE(biased, 5.6);
}

TEST_F(Speeds, MakeMetresOfAWalk) {
  const fs::path walk =
      render_once("small_walk", {"--walk", "--frames", "150", "--width", "320", "--height", "240"});
  const Words lengths = {"--set", "evaluation.segment_lengths_m=[1, 2]"};
  EXPECT_LE(t_rel_with(walk / "sequences/00", 0.0, lengths), 0.6);
  const double biased = t_rel_with(walk / "sequences/00", 0.05, lengths);
  EXPECT_GE(biased, 4.0);
  EXPECT_LE(biased, 6.0);
}

}  // namespace
}  // namespace stemvo
