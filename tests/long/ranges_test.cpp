// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "options/option_fields.hpp"
#include "support/program_test.hpp"

namespace stemvo {
namespace {

/// "KEY=VALUE" at both ends of every number.
std::vector<std::string> ends_of_all_numbers() {
  Options options;
  std::vector<std::string> ends;
  for (const options::Field& field : options::fields_of(options)) {
    if (std::holds_alternative<int*>(field.value) || std::holds_alternative<double*>(field.value)) {
      ends.push_back(fmt::format("{}={}", field.name(), field.rule.min));
      ends.push_back(fmt::format("{}={}", field.name(), field.rule.max));
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

}  // namespace
}  // namespace stemvo
