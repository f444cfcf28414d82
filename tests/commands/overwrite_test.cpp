// SPDX-License-Identifier: MIT
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

class Overwrite : public DriveCopy {};

TEST_F(Overwrite, NoCommandTakesAFolderThatIsNotItsOwn) {
  const fs::path mine = folder_ / "mine";
  fs::create_directory(mine);
  write_file(mine / "notes.txt", "mine");
  for (const char* command : {"run", "channel"}) {
    expect_error(run_stemvo({command, sequence_, "--out", mine}), 1,
                 {mine, "expected a new folder, an empty one or results of 'stemvo "});
    expect_error(run_stemvo({command, sequence_, "--out", sequence_ / "image_2"}), 1,
                 {sequence_ / "image_2", "expected a new folder"});
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(mine), fs::directory_iterator()), 1);
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
