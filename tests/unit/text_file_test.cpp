// SPDX-License-Identifier: MIT
#include "text/text_file.hpp"

#include <csignal>
#include <filesystem>
#include <iterator>
#include <string>

#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "support/temp_folder.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::read_all;
using testing::TempFolder;

std::ptrdiff_t num_files(const TempFolder& folder) {
  return std::distance(fs::directory_iterator(folder.path()), {});
}

TEST(WriteTextFile, APipeThatNobodyReadsIsAnError) {
  const TempFolder folder;
  const fs::path pipe = folder / "metrics.json";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const Status status = write_text_file(pipe, "new");
  ASSERT_FALSE(status);
  EXPECT_THAT(status.error().message, HasSubstr(pipe.string() + ": cannot write: "));
}

TEST(WriteTextFile, NamesTheFileItCannotWriteAndLeavesNothing) {
  const TempFolder folder;
  EXPECT_FALSE(check_can_write(folder.path()));
  EXPECT_FALSE(write_text_file(folder.path(), "new"));
  const fs::path nowhere = folder / "none" / "calib.txt";
  for (const Status& status : {check_can_write(nowhere), write_text_file(nowhere, "new")}) {
    ASSERT_FALSE(status);
    EXPECT_THAT(status.error().message, HasSubstr(nowhere.string()));
    EXPECT_THAT(status.error().message, HasSubstr("No such file"));
  }
  const fs::path file = folder.file("calib.txt", "old");
  ASSERT_TRUE(check_can_write(file));
  EXPECT_EQ(read_all(file), "old");
  ASSERT_TRUE(write_text_file(file, "new"));
  EXPECT_EQ(read_all(file), "new");
  EXPECT_EQ(num_files(folder), 1);
}

TEST(ReadRows, RefusesTooManyLinesAndOneThatIsTooLong) {
  const TempFolder folder;
  const auto read = [&](const std::string& text) { return read_rows(folder.file("a", text)); };
  const std::string longest(kMaxLineBytes, 'x');
  EXPECT_TRUE(read(longest + "\n" + longest));
  EXPECT_THAT(read("1\n" + longest + "x\n").error().message,
              HasSubstr("a:2: expected a line of at most 65536 bytes, found one of 65537"));
  EXPECT_THAT(read("1\n" + longest + "x").error().message, HasSubstr("a:2: "));
  const std::string most(kMaxLines, '\n');
  EXPECT_TRUE(read(most));
  EXPECT_THAT(read(most + "1").error().message,
              HasSubstr("a: expected at most 1000000 lines, found more"));
}

TEST(CheckCanWrite, APipeIsAnError) {
  const TempFolder folder;
  const fs::path pipe = folder / "calib.txt";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(check_can_write(pipe).error().message,
              HasSubstr(pipe.string() + ": expected a file to write, found a pipe"));
}

TEST(OneLine, IsOneAndNotLong) {
  EXPECT_EQ(one_line("a\nb"), "a b");
  EXPECT_EQ(one_line(std::string(1000, 'x')), std::string(300, 'x') + "..");
}

TEST(WriteTextFile, AFullDiskLeavesTheOldFile) {
  const TempFolder folder;
  const fs::path file = folder.file("poses.txt", "old");
  struct rlimit before = {};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const struct rlimit small = {1000, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const Status status = write_text_file(file, std::string(5000, 'x'));
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(status);
  EXPECT_THAT(status.error().message, HasSubstr(file.string() + ": cannot write: File too large"));
  EXPECT_EQ(read_all(file), "old");
  EXPECT_EQ(num_files(folder), 1);
  EXPECT_THAT(write_text_file("/dev/full", "x").error().message, HasSubstr("No space left"));
}

TEST(RemoveFile, TakesWhatAKilledWriteLeftOfItToo) {
  const TempFolder folder;
  const fs::path file = folder.path() / "checkpoint";
  ASSERT_TRUE(write_text_file(file, "whole"));
  ASSERT_TRUE(write_text_file(file.string() + ".unfinished", "cut o"));
  EXPECT_TRUE(remove_file(file));
  EXPECT_EQ(num_files(folder), 0);
  EXPECT_TRUE(remove_file(file));  // there is none
  ASSERT_TRUE(fs::create_directories(file / "not empty"));
  const Status status = remove_file(file);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("checkpoint: cannot be removed ("), std::string::npos);
}

TEST(WriteTextFile, FollowsALinkToTheFile) {
  const TempFolder folder;
  const fs::path file = folder.file("poses.txt", "old");
  fs::create_symlink(file, folder / "link.txt");
  ASSERT_TRUE(write_text_file(folder / "link.txt", "new"));
  EXPECT_TRUE(fs::is_symlink(folder / "link.txt"));
  EXPECT_EQ(read_all(file), "new");
}

TEST(WriteTextFile, NotThroughALinkWhereItIsUnfinished) {
  const TempFolder folder;
  const fs::path precious = folder.file("precious", "old");
  fs::create_symlink(precious, unfinished(folder / "new.txt"));
  ASSERT_TRUE(write_text_file(folder / "new.txt", "new"));
  EXPECT_EQ(read_all(precious), "old");
  EXPECT_FALSE(fs::is_symlink(folder / "new.txt"));
  EXPECT_EQ(num_files(folder), 2);
}

}  // namespace
}  // namespace stemvo
