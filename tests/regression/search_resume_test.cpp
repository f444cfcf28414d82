// SPDX-License-Identifier: MIT
#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include <gmock/gmock.h>

#include "support/search_program.hpp"

namespace stemvo {
namespace {

TEST_F(Search, KilledAndResumedGivesTheSameBytes) {
  const Words asked = {"--exhaustive", "--filters", "0:4", "--threads", "1", "--block", "100"};
  ASSERT_EQ(search("whole", asked).exit_code, 0);
  const Words other = {"--exhaustive", "--filters", "0:4", "--threads", "2", "--block", "1"};
  test::RunningProgram program(STEMVO_PROGRAM, command("killed", other));
  const fs::path records = folder_ / "killed/records.jsonl";
  for (int i = 0; i < 6000 && count_lines(records) < 3; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  program.send(SIGKILL);
  ASSERT_EQ(program.wait().exit_code, 128 + SIGKILL);
  const std::size_t done = count_lines(records);
  ASSERT_GE(done, 3U);
  ASSERT_LT(done, 9U) << "the search was over before it was killed";
  std::ofstream(records, std::ios::app) << "{\"model\":\"default\",\"la";  // as a kill may leave it
  EXPECT_THAT(search("killed", other).err, HasSubstr("--resume goes on with it"));
  const Words changed = {"--exhaustive", "--filters", "0:4", "--resume", "--set", "seed=2"};
  EXPECT_THAT(search("killed", changed).err, HasSubstr("seed: 1, now seed: 2"));
  Words resumed = other;
  resumed.emplace_back("--resume");
  const ProgramResult result = search("killed", resumed);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(count_lines(records), 9U);  // what searched, and 8 filters once
  EXPECT_EQ(table("killed"), table("whole"));
}

/// 16 filters, gray, and R, G and B are three blocks of the default size.
TEST_F(Search, KilledWithTheDefaultBlockKeepsTheBlocksThatEnded) {
  const Words asked = {"--exhaustive", "--threads", "1"};
  ASSERT_EQ(search("whole", asked).exit_code, 0);
  test::RunningProgram program(STEMVO_PROGRAM, command("killed", asked));
  const fs::path records = folder_ / "killed/records.jsonl";
  for (int i = 0; i < 15000 && count_lines(records) < 2; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  program.send(SIGKILL);
  ASSERT_EQ(program.wait().exit_code, 128 + SIGKILL) << "the search was over before it was killed";
  const std::string kept = read_file(records);
  ASSERT_EQ(std::count(kept.begin(), kept.end(), '\n'), 17);  // what searched, and one block
  Words resumed = asked;
  resumed.emplace_back("--resume");
  const ProgramResult result = search("killed", resumed);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(read_file(records), StartsWith(kept));
  EXPECT_EQ(count_lines(records), 21U);  // nothing was run again
  EXPECT_EQ(table("killed"), table("whole"));
}

/// Ctrl-C ends the program in order: a table of what is done, which says that it is not all.
TEST_F(Search, InterruptedLeavesAPartOfTheTableAndGoesOn) {
  const Words asked = {"--exhaustive", "--filters", "0:6", "--block", "2", "--threads", "1"};
  ASSERT_EQ(search("whole", asked).exit_code, 0);
  Words resumed = asked;
  resumed.emplace_back("--resume");
  const fs::path records = folder_ / "stopped/records.jsonl";
  for (const int signal : {SIGINT, SIGTERM}) {
    const std::size_t before = count_lines(records);
    test::RunningProgram program(STEMVO_PROGRAM, command("stopped", resumed));
    for (int i = 0; i < 15000 && count_lines(records) < std::max<std::size_t>(before + 1, 3); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    program.send(signal);
    const ProgramResult stopped = program.wait();
    ASSERT_EQ(stopped.exit_code, 130) << stopped.err;
    EXPECT_THAT(stopped.err, HasSubstr("interrupted; what is done is kept, --resume goes on"));
    EXPECT_FALSE(result("stopped")["complete"].get<bool>());
    const std::size_t rows = count_lines(folder_ / "stopped/filters.csv") - 1;
    EXPECT_EQ(rows, count_lines(records) - 1);
    EXPECT_EQ(result("stopped")["filters"].size(), rows);
    EXPECT_GE(rows, 2U);
    EXPECT_LT(rows, 10U);
  }
  ASSERT_EQ(search("stopped", resumed).exit_code, 0);
  EXPECT_EQ(table("stopped"), table("whole"));
  for (const char* file : {"/filters.json", "/best.yaml", "/config.yaml", "/sheet.png"}) {
    EXPECT_EQ(read_file(folder_ / (std::string("stopped") + file)),
              read_file(folder_ / (std::string("whole") + file)))
        << file;
  }
  EXPECT_TRUE(result("stopped")["complete"].get<bool>());
}

/// A line that no search wrote is named and left out; its filter is run again.
TEST_F(Search, ADamagedRecordIsNamedAndRunAgain) {
  const Words asked = {"--exhaustive", "--filters", "0:3", "--no-baselines"};
  ASSERT_EQ(search("out", asked).exit_code, 0);
  const std::string whole = table("out");
  const fs::path records = folder_ / "out/records.jsonl";
  std::string text = read_file(records);
  const std::size_t second = text.find('\n', text.find('\n') + 1) + 1;
  text.replace(text.find("\"rung\":0", second), 8, "\"rung\":9");
  write_file(records, text);
  Words resumed = asked;
  resumed.emplace_back("--resume");
  const ProgramResult result = search("out", resumed);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, StartsWith("warning: " + records.string() + ":3: expected a line"));
  EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
  EXPECT_EQ(table("out"), whole);
}

TEST_F(Search, ASheetThatCannotBeWrittenIsAnError) {
  for (const char* name : {"sheet.png", "report.html"}) {
    fs::remove(folder_ / "out" / name);  // which the search before this wrote
    fs::create_directories(folder_ / "out" / name);
    write_file(folder_ / "out/.stemvo",
               "Results of 'stemvo search': its next run may replace them.\n");
    expect_error(search("out", {"--exhaustive", "--filters", "0:1", "--no-baselines", "--resume"}),
                 1, {name, "expected a file to write, found a folder"});
    EXPECT_THAT(table("out"), HasSubstr("default,stem,0"));
    fs::remove(folder_ / "out" / name);
  }
}

/// As many bytes as before, one of them another: of a text the digit before its last point.
void spoil(const fs::path& file) {
  std::string bytes = read_file(file);
  ASSERT_GT(bytes.size(), 60U) << file;
  const std::size_t place = file.extension() == ".txt" ? bytes.rfind('.') - 1 : bytes.size() - 50;
  bytes[place] = static_cast<char>(bytes[place] + 1);
  std::ofstream(file, std::ios::binary) << bytes;
}

TEST_F(Search, ReplacedInputsAreNoticedAndNamed) {
  copy_sequence();
  copy_sequence("01");
  const Words asked = {(folder_ / "kitti/sequences/00"), "--exhaustive", "--filters", "0:1",
                       "--no-baselines"};
  ASSERT_EQ(search("out", asked).exit_code, 0);
  const std::string before = table("out");
  const Words resumed = {asked[0], asked[1], asked[2], asked[3], asked[4], "--resume"};
  const std::string kitti = folder_ / "kitti";
  const auto message = [&](const std::string& file) {
    const std::string bytes = read_file(kitti + file);
    spoil(kitti + file);
    const auto result = search("out", resumed);
    std::ofstream(kitti + file, std::ios::binary) << bytes;
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(table("out"), before);
    return result.err;
  };
  EXPECT_THAT(message("/sequences/00/image_2/000007.png"),
              HasSubstr("records.jsonl: the frames of 00 changed since"));
  EXPECT_THAT(message("/sequences/01/image_2/000029.png"),
              HasSubstr("records.jsonl: the frames of 01 changed since"));
  EXPECT_THAT(message("/poses/01.txt"),
              HasSubstr("records.jsonl: the pose file of 01 changed since"));
  EXPECT_THAT(message("/sequences/00/calib.txt"),
              HasSubstr("records.jsonl: calib.txt or times.txt of 00 changed since"));
  EXPECT_THAT(message("/sequences/00/times.txt"),
              HasSubstr("records.jsonl: calib.txt or times.txt of 00 changed since"));
  const auto as_it_was = search("out", resumed);
  EXPECT_EQ(as_it_was.exit_code, 0) << as_it_was.err;
  EXPECT_EQ(table("out"), before);
}

}  // namespace
}  // namespace stemvo
