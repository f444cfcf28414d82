// SPDX-License-Identifier: MIT
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>

#include "support/search_program.hpp"

namespace stemvo {
namespace {

TEST_F(Search, WrongRequestsAreNamedBeforeWorkStarts) {
  const auto message = [this](const Words& more) {
    const ProgramResult result = search("wrong", more);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_FALSE(fs::exists(folder_ / "wrong"));
    return result.err;
  };
  EXPECT_THAT(message({"--filters", "10:17"}), HasSubstr("inside 0:16"));
  EXPECT_THAT(message({"--model", "nothing"}), HasSubstr("expected default"));
  EXPECT_THAT(message({"--set", "scale.source=none"}), HasSubstr("expected ground_truth"));
  EXPECT_THAT(message({"--frames", "0:3"}), HasSubstr("holds a segment of 10 m"));
  EXPECT_THAT(message({"--held-out", folder_ / "none"}), HasSubstr("none"));
  fs::create_directories(folder_ / "sequences");
  fs::copy(sequence_, folder_ / "sequences/00", fs::copy_options::recursive);
  const ProgramResult blind =
      run_stemvo({"search", folder_ / "sequences/00", "--out", folder_ / "wrong"});
  EXPECT_THAT(blind.err, HasSubstr("expected a pose file, by which filters are ranked"));
  EXPECT_EQ(run_stemvo({"search", "--out", folder_ / "wrong"}).exit_code, 2);
}

TEST_F(Search, WhatIsAskedForTwiceIsRefused) {
  const auto message = [this](const Words& more) {
    const ProgramResult result = search("wrong", more);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_FALSE(fs::exists(folder_ / "wrong"));
    return result.err;
  };
  EXPECT_THAT(message({"--model", "default,default"}),
              HasSubstr("expected each name once, found 'default' again"));
  EXPECT_THAT(message({sequence_.string()}), HasSubstr("SEQUENCE_DIR: expected each folder once"));
  const std::string link = folder_ / "07";
  fs::create_directory_symlink(sequence_, link);
  fs::create_directories(folder_ / "poses");
  const std::string here = sequence_.string();
  EXPECT_THAT(message({"--held-out", here}),
              HasSubstr("--held-out: " + here +
                        ": expected frames that do not rank, found 0:30, of which 0:30 do"));
  EXPECT_THAT(message({"--frames", "0:20", "--held-out", here, "--held-out-frames", "18:30"}),
              HasSubstr("found 18:30, of which 18:20 do"));
  copy_sequence();
  EXPECT_THAT(message({here}),
              HasSubstr("expected each name, by which sequences are told apart, once"));
  // Other frames of a sequence that ranks may be held out, and so may its namesake elsewhere.
  const Words some = {"--exhaustive", "--no-baselines", "--filters", "2:3", "--frames", "0:15"};
  int count = 0;
  for (const Words& held_out :
       {Words{"--held-out", sequence_.string(), "--held-out-frames", "15:30"},
        Words{"--held-out", here}}) {
    Words words = some;
    words.insert(words.end(), held_out.begin(), held_out.end());
    const ProgramResult result = search("right" + std::to_string(count++), words);
    EXPECT_EQ(result.exit_code, 0) << result.err;
  }
}

TEST_F(Search, OptionsThatWouldBeIgnoredAreWrongUsage) {
  for (const Words& option :
       {Words{"--filters", "0:1"}, Words{"--frames", "0:9"}, Words{"--exhaustive"},
        Words{"--resume"}, Words{"--no-baselines"}, Words{"--set", "seed=2"},
        Words{"--config", "default"}, Words{"--model", "gray"}, Words{"--block", "3"},
        Words{"--threads", "1"}, Words{"--held-out", sequence_.string()}}) {
    Words words = {"search", "--merge", folder_ / "a", "--out", folder_ / "wrong"};
    words.insert(words.end(), option.begin(), option.end());
    const ProgramResult result = run_stemvo(words);
    EXPECT_EQ(result.exit_code, 2) << option.front();
    EXPECT_THAT(result.err,
                AllOf(HasSubstr(" excludes "), HasSubstr("--merge"), HasSubstr(option.front())));
  }
  for (const std::string key : {"model=gray", "filter=3"}) {
    const ProgramResult result = search("wrong", {"--set", "stem." + key});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, AllOf(HasSubstr("--set stem." + key.substr(0, key.find('='))),
                                  HasSubstr("which say what a search runs")));
  }
  EXPECT_FALSE(fs::exists(folder_ / "wrong"));
}

}  // namespace
}  // namespace stemvo
