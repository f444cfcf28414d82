// SPDX-License-Identifier: MIT
#include "support/program_test.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

class BadInput : public DriveCopy {
 protected:
  ProgramResult run(const Words& more = {}) const {
    return run_stemvo({"run", sequence_.string(), "--out", out_}, more);
  }
};

/// Decoders print lines of their own, which name no file.
TEST_F(BadInput, BrokenImagesAreOneWarningEach) {
  const fs::path images = sequence_ / "image_2";
  for (const char* name : {"000003.png", "000004.png", "000005.png", "000006.png"}) {
    std::string bytes = read_file(images / name);
    bytes.replace(bytes.size() / 2, 4, "xxxx");
    write_file(images / name, bytes);
  }
  std::string twice = read_file(images / "000008.png");
  write_file(images / "000008.png", twice.insert(33, twice.substr(8, 25)));  // two headers
  const ProgramResult result = run({"--quiet", "--set", "scale.source=none"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 6) << result.err;
  EXPECT_THAT(result.err,
              AllOf(HasSubstr("60 poses for 10 frames"),
                    HasSubstr("warning: " + images.string() + "/000003.png"),
                    HasSubstr("000008.png: expected a sound PNG image, found one damaged"),
                    Not(HasSubstr("libpng"))));
}

/// Poses that cannot be read are not poses that are not there.
TEST_F(BadInput, PosesBehindALinkToNowhere) {
  const fs::path poses = folder_.path() / "poses/00.txt";
  fs::remove(poses);
  fs::create_symlink("00.txt", poses);
  expect_error(run(), 1, {"poses/00.txt", "symbolic links"});
}

TEST_F(BadInput, ACheckThatCannotBeginIsAnErrorOfJUnit) {
  expect_error(run_stemvo({"check", folder_ / "no.json", "--baseline", folder_ / "b.json",
                           "--junit", folder_ / "junit.xml"}),
               1, {"no.json"});
  EXPECT_THAT(read_file(folder_ / "junit.xml"), HasSubstr("errors=\"1\""));
}

TEST_F(BadInput, Configuration) {
  expect_error(run({"--config", "nope"}), 1, {"nope: expected", "default, fast, paper", "neither"});
  expect_error(run({"--config", folder_.path().string()}), 1, {"found a folder"});
  expect_error(run({"--set", "stem.filter=3", "--set", "seed=2", "--set", "stem.filter=4"}), 1,
               {"--set stem.filter: expected once", "'stem.filter=3'", "'stem.filter=4'"});
  expect_error(run({"--map", folder_ / "poses/00.txt"}), 1,
               {"00.txt: expected a map of stemvo, found another kind of file"});
}

}  // namespace
}  // namespace stemvo
