// SPDX-License-Identifier: MIT
#include "text/text_file.hpp"

#include <csignal>

#include <sys/resource.h>

#include "support/test.hpp"

namespace stemvo {
namespace {

std::ptrdiff_t num_files(const TempFolder& folder) {
  return std::distance(fs::directory_iterator(folder.path()), {});
}

TEST(WriteTextFile, NamesTheFileItCannotWriteAndLeavesNothing) {
  const TempFolder folder;
  EXPECT_FALSE(write_text_file(folder.path(), "new"));
  const fs::path nowhere = folder / "none" / "calib.txt";
  const Status status = write_text_file(nowhere, "new");
  EXPECT_THAT(status.error().message, HasSubstr(nowhere.string()));
  EXPECT_THAT(status.error().message, HasSubstr("No such file"));
  const fs::path file = folder.file("calib.txt", "old");
  ASSERT_TRUE(write_text_file(file, "new"));
  EXPECT_EQ(read_all(file), "new");
  EXPECT_EQ(num_files(folder), 1);
}

TEST(ReadTextFile, AMarkOfWindowsEditorsIsNoText) {
  const TempFolder folder;
  EXPECT_EQ(read_text_file(folder.file("camera.yaml",
                                       "\xEF\xBB\xBF"
                                       "a: 1"))
                .value(),
            "a: 1");
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
  EXPECT_THAT(status.error().message, HasSubstr(file.string() + ": cannot write: File too large"));
  EXPECT_EQ(read_all(file), "old");
  EXPECT_EQ(num_files(folder), 1);
}

TEST(TextFile, OnlyRegularFilesUpToTheLimit) {
  const TempFolder folder;
  for (const fs::path& place : {fs::path("/dev/zero"), folder.path()}) {
    EXPECT_THAT(read_text_file(place).error().message,
                HasSubstr(place.string() + ": expected a file, found "));
    EXPECT_THAT(write_text_file(place, "x").error().message,
                HasSubstr(place.string() + ": expected a file to write, found "));
  }
  const fs::path file = folder.file("large.yaml", "");
  fs::resize_file(file, 5000000);
  EXPECT_TRUE(read_text_file(file));
  EXPECT_THAT(read_text_file(file, kMaxSettings_MB).error().message,
              HasSubstr("large.yaml: expected at most 1 MB, found 5 MB"));
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
  EXPECT_NE(status.error().message.find("checkpoint: cannot be removed ("), std::string::npos);
}

}  // namespace
}  // namespace stemvo
