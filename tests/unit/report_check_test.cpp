// SPDX-License-Identifier: MIT
#include "report/check.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr char kMetrics[] = R"({"t_rel_percent": 0.83, "tracked_fraction": 1.0, "frames": 400,
  "r_rel_deg_per_100m": null, "scale_source": "constant_speed", "segment_lengths_m": [100.0],
  "ate_rmse_m": {"none": 2.5, "sim3": 1.25}, "gone": null})";

Expected<std::vector<ThresholdResult>> check(const std::string& thresholds,
                                             const std::string& metrics = kMetrics) {
  const TempFolder folder;
  return check_metrics({folder.file("metrics.json", metrics),
                        folder.file("thresholds.yaml", thresholds), std::nullopt});
}

/// The error, or the first problem of a bound.
std::string problem_of(const Expected<std::vector<ThresholdResult>>& results) {
  if (!results) {
    return results.error().message;
  }
  for (const ThresholdResult& result : *results) {
    if (!result.problem.empty()) {
      EXPECT_FALSE(result.passed);
      return result.problem;
    }
  }
  return "no error";
}

Expected<std::vector<ThresholdResult>> compare(const std::string& metrics,
                                               const std::string& baseline,
                                               double tolerance = 0.05) {
  const TempFolder folder;
  return check_metrics({folder.file("metrics.json", metrics), std::nullopt,
                        folder.file("baseline.json", baseline), tolerance});
}

TEST(Check, ARunsFolderStandsForItsMetrics) {
  const TempFolder folder;
  for (const auto& baseline : {folder.file("metrics.json", kMetrics), folder.path()}) {
    const auto results = check_metrics({folder.path(), std::nullopt, baseline});
    EXPECT_TRUE(results && all_passed(*results));
  }
}

TEST(Check, PassesWhatIsWithinItsBounds) {
  const auto results = check(
      "# a comment\n"
      "t_rel_percent: {max: 1.0}\n"
      "tracked_fraction: {min: 0.99, max: 1}\n"
      "ate_rmse_m.none:\n  max: 3\n"
      "frames: {min: 400}\n");
  ASSERT_EQ(results->size(), 5U);
  EXPECT_TRUE(all_passed(*results));
  EXPECT_EQ((*results)[0].key, "t_rel_percent");
  EXPECT_TRUE((*results)[0].is_max);
  EXPECT_EQ((*results)[0].limit, 1.0);
  EXPECT_EQ((*results)[0].number, 0.83);
  EXPECT_FALSE((*results)[1].is_max);
  EXPECT_EQ((*results)[3].key, "ate_rmse_m.none");
  EXPECT_EQ((*results)[3].number, 2.5);
}

TEST(Check, FailsAMetricThatIsNull) {
  const auto results =
      check("r_rel_deg_per_100m: {max: 100}\ngone.none: {max: 100}\nt_rel_percent: {max: 1}\n");
  EXPECT_FALSE((*results)[0].passed);
  EXPECT_FALSE((*results)[0].number);
  EXPECT_THAT(format_check_table(*results), ::testing::ContainsRegex("100m +null +<= 100 +FAILED"));
  EXPECT_FALSE((*results)[1].passed);
  EXPECT_TRUE((*results)[2].passed);
}

TEST(Check, BrokenThresholdsAreNamedWithTheirLine) {
  for (const auto& [thresholds, complaint] :
       {std::pair("frames: {min: 1}\nt_rel: {max: 1}\n", ":2: expected a metric of"),
        {"ate_rmse_m.se4: {max: 1}\n", "found 'ate_rmse_m.se4'"},
        {"frames.sub: {max: 1}\n", "found 'frames.sub'"},
        {"t_rel_percent: {maximum: 1}\n",
         ":1: t_rel_percent: expected min or max, found 'maximum'"},
        {"t_rel_percent: 1.0\n", "expected {max: NUMBER} or {min: NUMBER}, found '1.0'"},
        {"t_rel_percent:\n", "expected {max: NUMBER}"},
        {"t_rel_percent: {}\n", "expected {max: NUMBER}"},
        {"t_rel_percent: {max: low}\n", "t_rel_percent.max: expected a finite number, found 'low'"},
        {"t_rel_percent: {max: .nan}\n", "expected a finite number"},
        {"t_rel_percent: {max: [1]}\n", "expected 1 number, found 0"},
        {"frames: {min: 1\n", "not YAML"},
        {"- frames\n", "expected lines like"},
        {"", "expected lines like"},
        {"[a]: {min: 1}\n", "expected {max: NUMBER}"}}) {
    const std::string problem = problem_of(check(thresholds));
    EXPECT_THAT(problem, AllOf(HasSubstr("thresholds.yaml:"), HasSubstr(complaint)));
    EXPECT_EQ(problem.find('\n'), std::string::npos);
  }
}

TEST(Check, NamesMetricsThatCannotBeRead) {
  const std::string thresholds = "t_rel_percent: {max: 1}\n";
  const auto message = [&](const std::string& metrics) {
    return problem_of(check(thresholds, metrics));
  };
  EXPECT_THAT(message("[]"), HasSubstr("expected a JSON object, found array"));
  EXPECT_THAT(message(R"({"t_rel_percent": "low"})"),
              HasSubstr("t_rel_percent: expected a number, found string"));
  EXPECT_THAT(message(R"({"t_rel_percent": true})"), HasSubstr("expected a number, found boolean"));
  const std::string deep = std::string(100000, '[') + std::string(100000, ']');
  EXPECT_EQ(message("{\"t_rel_percent\": 1, \"a\": " + deep + "}"), "no error");
}

TEST(Check, HoldsEveryBoundBesideOneWithAProblem) {
  const auto results =
      check("t_rel: {max: 1}\nframes: {min: 500, most: 3}\nt_rel_percent: {max: 1}\n");
  ASSERT_EQ(results->size(), 4U);
  EXPECT_THAT((*results)[0].problem, HasSubstr(":1: expected a metric of"));
  EXPECT_EQ((*results)[1].number, 400.0);
  EXPECT_FALSE((*results)[1].passed);
  EXPECT_THAT((*results)[2].problem, HasSubstr(":2: frames: expected min or max, found 'most'"));
  EXPECT_TRUE((*results)[3].passed);
  EXPECT_THAT(format_check_table(*results), HasSubstr("3 of 4 bounds not kept\n"));
  EXPECT_THAT(format_check_table(*results), HasSubstr(":2: frames: expected min or max"));
}

constexpr char kBaseline[] =
    R"({"frames": 400, "alignment": "none", "t_rel_percent": 0.8, "fps": 100,
  "r_rel_deg_per_100m": null, "ate_rmse_m": {"sim3": 1.0},
  "tracked_fraction": 1.0, "map": {"t_rel_percent": 0.5}})";

TEST(Check, ABaselineBoundsItsErrorsByTheTolerance) {
  const std::string run = R"({"frames": 400, "alignment": "none", "t_rel_percent": 0.83, "fps": 1,
    "ate_rmse_m": {"sim3": 1.06}, "tracked_fraction": 0.96, "map": {"t_rel_percent": null}})";
  const auto results = compare(run, kBaseline);
  ASSERT_EQ(results->size(), 4U);
  const auto expect = [&](std::size_t i, const std::string& key, double limit, bool passed) {
    EXPECT_EQ((*results)[i].key, key);
    EXPECT_NEAR((*results)[i].limit, limit, 1e-12);
    EXPECT_EQ((*results)[i].passed, passed) << key;
  };
  expect(0, "t_rel_percent", 0.84, true);
  expect(1, "ate_rmse_m.sim3", 1.05, false);
  expect(2, "map.t_rel_percent", 0.525, false);  // null
  expect(3, "tracked_fraction", 0.95, true);
  EXPECT_TRUE(compare(run, kBaseline, 0.07)->at(1).passed);
  EXPECT_TRUE(all_passed(*compare(kBaseline, kBaseline, 0.0)));
}

TEST(Check, ABaselineOfAnotherRecordingOtherFramesOrAnotherAlignmentIsAProblem) {
  EXPECT_THAT(problem_of(compare(replace_first(kBaseline, "400", "399"), kBaseline)),
              HasSubstr("baseline.json: frames: expected 399 as in the run, found 400"));
  EXPECT_THAT(problem_of(compare(replace_first(kBaseline, "none", "sim3"), kBaseline)),
              HasSubstr(R"(expected "sim3" as in the run, found "none")"));
  EXPECT_THAT(problem_of(compare(R"({"sequence": "00", "t_rel_percent": 0.1})",
                                 R"({"sequence": "03", "t_rel_percent": 0.1})")),
              HasSubstr(R"(sequence: expected "00" as in the run, found "03")"));
  for (const char* key : {"first_frame", "scale_source"}) {
    const auto run = [key](int value) {
      return fmt::format(R"({{"{}": {}, "t_rel_percent": 0.1}})", key, value);
    };
    EXPECT_THAT(problem_of(compare(run(0), run(5))),
                HasSubstr("expected 0 as in the run, found 5"));
  }
  EXPECT_THAT(problem_of(compare(kBaseline, "{}")), HasSubstr("expected numbers of a run"));
}

TEST(Check, JunitHasACasePerBound) {
  const auto results =
      check("frames: {min: 1}\nt_rel_percent: {max: 0.5}\n\"a<b\": {max: 1}\n").value();
  const std::string xml = format_junit(results, "a&b");
  EXPECT_THAT(xml,
              HasSubstr("<testsuite name=\"a&amp;b\" tests=\"3\" failures=\"1\" errors=\"1\">\n"));
  EXPECT_THAT(xml, HasSubstr("<testcase classname=\"a&amp;b\" name=\"frames &gt;= 1\"/>\n"));
  EXPECT_THAT(
      xml, HasSubstr("name=\"t_rel_percent &lt;= 0.5\"><failure message=\"0.83\"/></testcase>\n"));
  EXPECT_THAT(xml, HasSubstr("name=\"a&lt;b\"><error message=\""));
  EXPECT_THAT(xml, HasSubstr("found 'a&lt;b'\"/></testcase>\n</testsuite>\n"));
}

}  // namespace
}  // namespace stemvo
