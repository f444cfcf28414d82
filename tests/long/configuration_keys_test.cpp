// SPDX-License-Identifier: MIT
#include "options/visit.hpp"
#include "support/bad_input_table.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// "KEY=VALUE" at both ends of every number.
Words ends_of_all_numbers() {
  Options options;
  Words ends;
  options::visit(options, [&](std::string_view section, std::string_view name, auto& value,
                              const options::Rule& rule, std::string_view) {
    using Value = std::remove_cvref_t<decltype(value)>;
    if (std::is_same_v<Value, int> || std::is_same_v<Value, double>) {
      const std::string key = options::full_name(section, name);
      ends.push_back(fmt::format("{}={}", key, rule.min));
      ends.push_back(fmt::format("{}={}", key, rule.max));
    }
  });
  return ends;
}

ProgramResult run_with(const std::string& assignment, const TempFolder& folder) {
  const fs::path drive = rendered_drive({.frames = 30, .width_px = 310, .height_px = 94});
  return run_stemvo({"run", drive / "sequences/00", "--frames", "0:6", "--quiet", "--out",
                     folder / "out", "--set", assignment});
}

TEST(Ranges, NoEndIsACrash) {
  const TempFolder folder;
  for (const std::string& assignment : ends_of_all_numbers()) {
    const ProgramResult result = run_with(assignment, folder);
    EXPECT_THAT(result.exit_code, ::testing::AnyOf(0, 1)) << assignment << ": " << result.err;
    EXPECT_THAT(result.err, Not(HasSubstr("internal:"))) << assignment;
    if (result.exit_code == 0) {
      const std::string poses = read_file(folder / "out/trajectory_kitti.txt");
      EXPECT_THAT(poses, AllOf(Not(HasSubstr("nan")), Not(HasSubstr("inf")))) << assignment;
    }
  }
}

/// Every key with every value that it cannot have; and that it can have those at its ends, which
/// shows in that the next thing is missed.
TEST_F(BadInputTable, ConfigurationKeys) {
  Options options;
  std::vector<Case> cases;
  const std::string none = folder_ / "none";
  const auto add = [&](const std::string& key, const std::string& value, const std::string& word) {
    const std::string assignment = key + "=" + value;
    cases.push_back(
        {assignment, {"run", none, "--out", folder_ / "out", "--set", assignment}, word});
  };
  options::visit(options, [&](std::string_view section, std::string_view name, auto& value,
                              const options::Rule& rule, std::string_view) {
    using Value = std::remove_cvref_t<decltype(value)>;
    constexpr bool is_whole = std::is_same_v<Value, int>;
    const std::string key = options::full_name(section, name);
    if (is_whole || std::is_same_v<Value, double>) {
      const double step = is_whole ? 1.0 : 1e-6;
      const double beyond = 1.001 * rule.max + step;
      add(key, fmt::format("{}", rule.min - step), key);
      add(key, fmt::format("{}", is_whole ? std::ceil(beyond) : beyond), key);
      add(key, "nan", key);
      add(key, "1e300", key);
      const bool is_pair = key.starts_with("stem.contrast_");  // one of them ends at the other
      add(key, fmt::format("{}", rule.min), is_pair ? "error" : none);
      add(key, fmt::format("{}", rule.max), is_pair ? "error" : none);
    }
    if (!std::is_same_v<Value, std::string>) {
      add(key, "x", key);
      add(key, "", key);
    }
  });
  EXPECT_GT(cases.size(), 250U);
  expect_refused(cases);
}

}  // namespace
}  // namespace stemvo
