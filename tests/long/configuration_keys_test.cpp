// SPDX-License-Identifier: MIT
#include "options/visit.hpp"
#include "support/program_test.hpp"
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

}  // namespace
}  // namespace stemvo
