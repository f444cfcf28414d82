// SPDX-License-Identifier: MIT
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

class Overwrite : public DriveCopy {};

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

TEST(OverwriteByCheck, SparesWhatItReads) {
  const TempFolder folder;
  const std::string numbers = R"({"t_rel_percent": 1})";
  write_file(folder / "metrics.json", numbers);
  write_file(folder / "before.json", numbers);
  write_file(folder / "limits.yaml", "t_rel_percent: {max: 2}\n");
  const Words check = {"check",     folder / "metrics.json", "--baseline", folder / "before.json",
                       "--against", folder / "limits.yaml"};
  for (const char* name : {"metrics.json", "before.json", "limits.yaml"}) {
    const std::string before = read_file(folder / name);
    expect_error(run_stemvo(check, {"--junit", folder / name}), 1,
                 {name, "expected a file to write that is no input"});
    EXPECT_EQ(read_file(folder / name), before);
  }
  expect_error(run_stemvo(check, {"--junit", folder / "none/junit.xml"}), 1, {"none/junit.xml"});
  succeeded(run_stemvo(check, {"--junit", folder / "junit.xml"}));
}

TEST_F(Overwrite, NoCommandTakesAFolderThatIsNotItsOwn) {
  const fs::path mine = folder_ / "mine";
  fs::create_directory(mine);
  write_file(mine / "notes.txt", "mine");
  for (const char* command : {"run", "channel"}) {
    expect_error(run_stemvo({command, sequence_, "--out", mine}), 1,
                 {mine, "expected a new folder, an empty one or results of 'stemvo "});
    expect_error(run_stemvo({command, sequence_, "--out", sequence_ / "image_2"}), 1,
                 {sequence_ / "image_2", "expected a folder that holds no input"});
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(mine), fs::directory_iterator()), 1);
}

TEST_F(Overwrite, PosesThatADriveIsRenderedAlongStay) {
  const std::string drive = folder_ / "drive";
  const Words synth = {"synth", drive, "--frames", "2"};
  succeeded(run_stemvo(synth));
  const fs::path poses = fs::path(drive) / "poses/00.txt";
  const std::string before = read_file(poses);
  expect_error(run_stemvo(synth, {"--trajectory", poses}), 1, {poses});
  EXPECT_EQ(read_file(poses), before);
}

TEST_F(Overwrite, NothingIsLeftInTheUsersHome) {
  const fs::path home = folder_ / "home";
  fs::create_directory(home);
  succeeded(run_program("/usr/bin/env",
                        {"HOME=" + home.string(), "XDG_CACHE_HOME=" + (home / "cache").string(),
                         STEMVO_PROGRAM, "run", sequence_, "--quiet", "--out", out_}));
  EXPECT_TRUE(fs::is_empty(home)) << "ONNX Runtime's telemetry keeps a file there";
}

}  // namespace
}  // namespace stemvo
