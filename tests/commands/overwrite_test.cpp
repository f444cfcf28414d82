// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

/// A copy of ten rendered frames, which no command writes over.
class Overwrite : public ::testing::Test {
 protected:
  TempFolder folder_;
  fs::path sequence_ = test::copy_drive(folder_.path(), 10);
  std::string out_ = folder_ / "out";
};

TEST_F(Overwrite, SynthSparesWhatItDidNotRender) {
  const std::string image = read_file(sequence_ / "image_2/000003.png");
  const std::string poses = read_file(folder_ / "poses/00.txt");
  expect_error(run_stemvo({"synth", folder_.path().string(), "--frames", "2"}), 1,
               {"poses/00.txt", "expected poses of a rendered drive or none"});
  EXPECT_EQ(read_file(sequence_ / "image_2/000003.png"), image);
  EXPECT_EQ(read_file(folder_ / "poses/00.txt"), poses);
}

TEST_F(Overwrite, CalibrateSparesWhatItReads) {
  write_file(folder_ / "my.yaml", "seed: 1\n");
  fs::create_symlink(sequence_ / "times.txt", folder_ / "link.txt");
  for (const fs::path& file :
       {sequence_ / "calib.txt", sequence_ / "times.txt", folder_ / "link.txt", folder_ / "my.yaml",
        sequence_ / "image_2/000003.png", folder_ / "poses/00.txt"}) {
    const std::string before = read_file(file);
    expect_error(run_stemvo({"calibrate", sequence_.string(), "--config", folder_ / "my.yaml",
                             "--out", file.string()}),
                 1, {file.string(), "expected a file to write that is no input"});
    EXPECT_EQ(read_file(file), before);
  }
}

TEST_F(Overwrite, NoCommandTakesAFolderThatIsNotItsOwn) {
  const std::string folder = sequence_ / "image_2";
  for (const char* command : {"run", "search", "robustness", "channel"}) {
    expect_error(run_stemvo({command, sequence_, "--out", folder}), 1,
                 {folder, "expected a new folder, an empty one or results of stemvo"});
  }
  expect_error(run_stemvo({"benchmark", folder_.path(), "--out", folder}), 1,
               {folder, "expected a new folder, an empty one or results of stemvo"});
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 10);
}

TEST_F(Overwrite, ARunIsRepeatedWithItsOwnConfiguration) {
  ASSERT_EQ(run_stemvo({"run", sequence_, "--quiet", "--out", out_}).exit_code, 0);
  const ProgramResult again =
      run_stemvo({"run", sequence_, "--quiet", "--out", out_, "--config", out_ + "/config.yaml"});
  EXPECT_EQ(again.exit_code, 0) << again.err;
}

}  // namespace
}  // namespace stemvo
