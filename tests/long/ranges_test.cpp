// SPDX-License-Identifier: MIT
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "options/option_fields.hpp"
#include "support/program_test.hpp"

namespace stemvo {
namespace {

/// "KEY=VALUE" at, and beyond, both ends of every number.
struct Ends {
  std::vector<std::string> inside;
  std::vector<std::string> outside;
};

Ends ends_of_all_numbers() {
  Options options;
  Ends ends;
  for (const options::Field& field : options::fields_of(options)) {
    const bool is_whole = std::holds_alternative<int*>(field.value);
    if (!is_whole && !std::holds_alternative<double*>(field.value)) {
      continue;
    }
    EXPECT_TRUE(std::isfinite(field.rule.min) && std::isfinite(field.rule.max)) << field.name();
    const double step = is_whole ? 1.0 : 1e-6;
    for (const auto& [end, beyond] : {std::pair(field.rule.min, field.rule.min - step),
                                      std::pair(field.rule.max, 1.001 * field.rule.max + step)}) {
      ends.inside.push_back(fmt::format("{}={}", field.name(), end));
      ends.outside.push_back(
          fmt::format("{}={}", field.name(), is_whole ? std::ceil(beyond) : beyond));
    }
  }
  return ends;
}

ProgramResult run_with(const std::string& assignment, const TempFolder& folder) {
  const fs::path drive = test::rendered_drive({.frames = 30, .width_px = 310, .height_px = 94});
  return run_stemvo({"run", drive / "sequences/00", "--frames", "0:6", "--quiet", "--out",
                     folder / "out", "--set", assignment});
}

TEST(Ranges, NoEndIsACrash) {
  const TempFolder folder;
  for (const std::string& assignment : ends_of_all_numbers().inside) {
    const ProgramResult result = run_with(assignment, folder);
    EXPECT_THAT(result.exit_code, ::testing::AnyOf(0, 1)) << assignment << ": " << result.err;
    EXPECT_THAT(result.err, Not(HasSubstr("internal:"))) << assignment;
    if (result.exit_code == 0) {
      const std::string poses = read_file(folder / "out/trajectory_kitti.txt");
      EXPECT_THAT(poses, AllOf(Not(HasSubstr("nan")), Not(HasSubstr("inf")))) << assignment;
    }
  }
}

TEST(Ranges, BeyondEachEndIsRefused) {
  const TempFolder folder;
  for (const std::string& assignment : ends_of_all_numbers().outside) {
    const std::string key = assignment.substr(0, assignment.find('='));
    expect_error(run_with(assignment, folder), 1, {key, "expected", "found"});
  }
}

}  // namespace
}  // namespace stemvo
