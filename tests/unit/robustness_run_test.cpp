// SPDX-License-Identifier: MIT
// The command in this process, under the sanitizers too.
#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "pipeline/out_folder.hpp"
#include "robustness/robustness.hpp"
#include "support/small_drive.hpp"

namespace stemvo::robustness {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::read_all;

class RobustnessRun : public testing::SmallDrive {
 protected:
  RobustnessRun() {
    request_.sequence_dirs = {sequence_};
    request_.out_dir = folder_ / "out";
    request_.config.scale_choice = ScaleChoice::kGroundTruth;
    request_.config.evaluation.segment_lengths_m = {2.0, 4.0};
    request_.kinds = {kUndisturbed, "sensor_noise", "every_nth"};
    request_.controls = {"gray", "default:2", "orb"};
    request_.num_threads = 2;
  }
  [[nodiscard]] std::string error() const {
    const auto report = run_robustness(request_);
    return report ? "no error" : report.error().message;
  }

  RobustnessRequest request_;
};

TEST_F(RobustnessRun, JudgesEachRow) {
  const auto report = run_robustness(request_);
  ASSERT_TRUE(report) << report.error().message;
  ASSERT_EQ(report->rows.size(), 7U);
  EXPECT_EQ(report->contenders.size(), 4U);
  for (const Row& row : report->rows) {
    ASSERT_EQ(row.verdicts.size(), 3U);
    EXPECT_EQ(row.verdicts[1].rotation.ratio, 1.0) << "against itself";
    EXPECT_EQ(row.outcomes[0][0].r_rel_deg_per_100m, row.outcomes[2][0].r_rel_deg_per_100m);
  }
  EXPECT_LT(report->rows[0].outcomes[0][0].r_rel_deg_per_100m,
            report->rows[3].outcomes[0][0].r_rel_deg_per_100m)
      << "the strongest noise";
  const std::string csv = read_all(request_.out_dir / "robustness.csv");
  EXPECT_EQ(csv, format_csv(*report));
  EXPECT_EQ(std::ranges::count(csv, '\n'), 1 + 7 * 4);
  EXPECT_EQ(nlohmann::json::parse(read_all(request_.out_dir / "robustness.json"))["rows"].size(),
            7U);
  EXPECT_THAT(read_all(request_.out_dir / "robustness.txt"),
              AllOf(HasSubstr("sensor_noise"), HasSubstr("over gray")));
  EXPECT_THAT(read_all(request_.out_dir / "report.html"), HasSubstr("every_nth"));
}

TEST_F(RobustnessRun, StoppedItKeepsTheRowsThatWereFinished) {
  request_.controls = {"gray"};
  request_.progress = [](std::size_t runs, std::size_t total) {
    EXPECT_EQ(total, 7U * 2U);
    return runs < 5;
  };
  const auto report = run_robustness(request_);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_TRUE(report->interrupted);
  EXPECT_EQ(report->rows.size(), 2U);
  EXPECT_TRUE(nlohmann::json::parse(read_all(request_.out_dir / "robustness.json"))["interrupted"]);
}

TEST_F(RobustnessRun, SaysWhatItCannotDo) {
  request_.kinds = {"hail"};
  EXPECT_THAT(error(), AllOf(HasSubstr("--kinds"), HasSubstr("hail")));
  request_.kinds = {kUndisturbed};
  request_.controls = {"infrared"};
  EXPECT_THAT(error(), AllOf(HasSubstr("--controls"), HasSubstr("infrared")));
  request_.controls = {"default:99"};
  EXPECT_THAT(error(), HasSubstr("99"));
  request_.controls = {"gray"};
  {
    std::filesystem::create_directories(request_.out_dir);
    const auto other = pipeline::lock_folder(request_.out_dir);
    EXPECT_THAT(error(), HasSubstr("no other stemvo writes to"));
  }
  request_.sequence_dirs.push_back(sequence_);
  EXPECT_THAT(error(), HasSubstr("each sequence once"));
  std::filesystem::remove(folder_ / "poses/00.txt");
  EXPECT_THAT(error(), HasSubstr("expected ground truth"));
}

}  // namespace
}  // namespace stemvo::robustness
