// SPDX-License-Identifier: MIT
#include "stemvo/version.hpp"
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

const Words kCommands = {"run", "evaluate", "channel", "synth", "calibrate", "check", "models"};

TEST(CommandLine, EveryCommandHasHelpAndVersion) {
  for (const std::string& command : kCommands) {
    const ProgramResult help = run_stemvo({command, "--help"});
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_THAT(help.out, HasSubstr("Usage: stemvo " + command)) << command;
    EXPECT_THAT(help.err, IsEmpty()) << command;
    const ProgramResult version = run_stemvo({command, "--version"});
    EXPECT_EQ(version.exit_code, 0) << command;
    EXPECT_THAT(version.out, StartsWith("stemvo 0.")) << command;
  }
}

TEST(CommandLine, VersionIsOneLine) {
  const ProgramResult result = run_stemvo({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.out, "stemvo " + std::string(version()) + "\n");
}

struct Misuse {
  Words arguments;
  std::string says;
};

TEST(CommandLine, WrongUsageIsOneLineAndExitCodeTwo) {
  const std::vector<Misuse> cases = {
      {{}, "expected a command"},
      {{"drive"}, "drive"},
      {{"run"}, "INPUT"},
      {{"channel", "x"}, "--out"},
      {{"run", "x", "--out", "o", "--bogus"}, "--bogus"},
      {{"run", "x", "--out", "o", "--frames", "7"}, "expected A:B"},
      {{"run", "x", "--out", "o", "--frames", "7:3"}, "A < B"},
      {{"run", "x", "--out", "o", "--set", "stem.filter"}, "expected KEY=VALUE"},
      {{"run", "x", "--out", "o", "--threads", "-1"}, "--threads"},
      {{"run", "x", "--out", "o", "--threads", "1.5"}, "a whole number from 0 to 1024, found 1.5"},
      {{"run", "x", "--out", "o", "--pictures", "0"}, "--pictures"},
      {{"run", "x", "--save-map", "--timing"}, "--save-map: expected a file, found --timing"},
      {{"evaluate", "--gt", "a"}, "ESTIMATE"},
      {{"evaluate", "--gt", "a", "b", "--align", "icp"}, "--align"},
      {{"channel", "x", "--out", "o", "--filters", "4:4"}, "A < B"},
      {{"synth", "x", "--frames", "0"}, "--frames"},
      {{"synth", "x", "--seed", "-3"}, "--seed"},
      {{"evaluate", "--gt", "a", "b", "--gt-tolerance", "nan"}, "from 0 to 3600, found nan"},
      {{"run", "x", "--out", "o", "--gt-tolerance", "inf"}, "--gt-tolerance"},
      {{"synth", "x", "--name", "../x"}, "--name"},
      {{"synth", "x", "--walk", "--trajectory", "p.txt"}, "--trajectory"},
      {{"calibrate", "x"}, "--out"},
      {{"calibrate", "--out", "o"}, "INPUT"},
      {{"check", "metrics.json"}, "--against"},
      {{"check", "m", "--baseline", "b", "--tolerance", "200%"}, "0% to 100%, found 200%"},
      {{"check", "m", "--baseline", "b", "--tolerance", "5%%"}, "found 5%%"},
      {{"runn", "x", "--out", "o"}, "models, found 'runn'"},
  };
  for (const Misuse& misuse : cases) {
    const ProgramResult result = run_stemvo(misuse.arguments);
    EXPECT_EQ(result.exit_code, 2) << misuse.says;
    EXPECT_THAT(result.out, IsEmpty());
    EXPECT_THAT(result.err, AllOf(StartsWith("error: "), HasSubstr(misuse.says)));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  }
}

TEST(CommandLine, OutputThatCannotBeWrittenIsAnError) {
  const ProgramResult full =
      run_program("/bin/sh", {"-c", std::string(STEMVO_PROGRAM) + " --dump-config > /dev/full"});
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_THAT(full.err, StartsWith("error: standard output: "));
}

}  // namespace
}  // namespace stemvo
