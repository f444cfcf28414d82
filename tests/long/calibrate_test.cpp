// SPDX-License-Identifier: MIT
#include "support/program_test.hpp"
#include "support/shared_data.hpp"
#include "support/state_runs.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

struct Intrinsics {
  double f = 0.0;
  double cx = 0.0;
  double cy = 0.0;
};

Intrinsics read_intrinsics(const fs::path& file) {
  Intrinsics result;
  const std::string text = read_file(file);
  const std::size_t at = text.find("P2:");
  double zero = 0.0;
  double fy = 0.0;
  const int read = at == std::string::npos
                       ? 0
                       : std::sscanf(text.c_str() + at, "P2: %lf %lf %lf %lf %lf %lf %lf",
                                     &result.f, &zero, &result.cx, &zero, &zero, &fy, &result.cy);
  EXPECT_EQ(read, 7) << file;
  EXPECT_EQ(result.f, fy);
  return result;
}

void write_intrinsics(const fs::path& file, const Intrinsics& k) {
  write_file(file, fmt::format("P2: {0:.12e} 0 {1:.12e} 0 0 {0:.12e} {2:.12e} 0 0 0 1 0\n", k.f,
                               k.cx, k.cy));
}

class Calibrate : public ::testing::Test {
 protected:
  ProgramResult calibrate(const Words& more) const {
    return run_stemvo({"calibrate", sequence_.string(), "--out", out_}, more);
  }

  TempFolder folder_;
  std::string out_ = folder_ / "refined.txt";
  fs::path sequence_ = rendered_drive() / "sequences/00";
};

// The images show no distortion, so that what is found is the camera that rendered them.
TEST_F(Calibrate, FindsTheCameraThatRenderedTheWalk) {
  sequence_ = render_walk_once(300) / "sequences/00";
  const Intrinsics truth = read_intrinsics(sequence_ / "calib.txt");
  const std::string wrong = folder_ / "wrong.txt";
  write_intrinsics(wrong, {1.03 * truth.f, truth.cx + 4.0, truth.cy - 3.0});
  const ProgramResult result = succeeded(calibrate({"--calib", wrong}));
  const Intrinsics found = read_intrinsics(out_);
  EXPECT_NEAR(found.f / truth.f, 1.0, 0.006);
  EXPECT_NEAR(found.cx, truth.cx, 1.0);
  EXPECT_NEAR(found.cy, truth.cy, 1.0);
  EXPECT_THAT(result.out, AllOf(HasSubstr("focal length"), HasSubstr("sigma"), HasSubstr("k1"),
                                HasSubstr(out_)));
  EXPECT_THAT(result.err, HasSubstr("300/300 frames"));
  std::cout << result.out;
}

TEST_F(Calibrate, ARunUsesTheFileItIsGivenAndNoOther) {
  const fs::path copy = copy_drive(folder_.path(), 12);
  const std::string wrong = folder_ / "wrong.txt";
  const Intrinsics truth = read_intrinsics(copy / "calib.txt");
  write_intrinsics(wrong, {1.1 * truth.f, truth.cx, truth.cy});
  const auto run = [&](const std::string& out, const Words& more) {
    succeeded(run_stemvo({"run", copy.string(), "--out", folder_ / out, "--quiet"}, more));
    return read_file(folder_ / (out + "/trajectory_kitti.txt"));
  };
  const std::string own = run("own", {});
  const std::string given = run("given", {"--calib", wrong});
  fs::copy_file(wrong, copy / "calib.txt", fs::copy_options::overwrite_existing);
  EXPECT_EQ(given, run("replaced", {}));
  EXPECT_NE(given, own);
  EXPECT_THAT(read_file(folder_ / "given/config.yaml"), HasSubstr("# calibration " + wrong));
}

// Many sigmas from the given one, but on a straight road a sigma is worth little.
TEST_F(Calibrate, AStraightRoadTellsNothing) {
  STEMVO_NEEDS_SHARED_DATA();
  sequence_ = shared_data() / "kitti/sequences/06";
  const ProgramResult result = calibrate({});
  EXPECT_EQ(result.exit_code, 1) << result.out;
  EXPECT_THAT(result.err, HasSubstr("determines neither"));
  EXPECT_FALSE(fs::exists(out_));
}

void expect_error(const ProgramResult& result, const Words& words) {
  EXPECT_EQ(result.exit_code, 1) << result.out;
  EXPECT_THAT(result.err, HasSubstr("error: "));
  EXPECT_THAT(result.err, ::testing::Not(HasSubstr("internal")));
  for (const std::string& word : words) {
    EXPECT_THAT(result.err, HasSubstr(word));
  }
}

TEST_F(Calibrate, WhatIsWrongIsSaid) {
  expect_error(calibrate({"--frames", "0:2", "--quiet"}), {sequence_.string(), "2 frames"});
  expect_error(calibrate({"--calib", folder_ / "none.txt"}), {"none.txt"});
  const std::string other = folder_ / "other.txt";
  write_intrinsics(other, {1000.0, 2000.0, 100.0});
  expect_error(calibrate({"--calib", other}), {"other.txt", "620x188", "2000"});
  expect_error(run_stemvo({"run", sequence_.string(), "--out", folder_ / "o", "--calib", other}),
               {"other.txt", "620x188"});
  write_intrinsics(out_, read_intrinsics(sequence_ / "calib.txt"));
  expect_error(calibrate({"--calib", out_}), {out_, "no input"});
  fs::remove(out_);
  expect_error(run_stemvo({"calibrate", folder_ / "none", "--out", out_}), {folder_ / "none"});
  expect_error(run_stemvo({"calibrate", sequence_.string(), "--out", folder_.path().string()}),
               {folder_.path().string(), "folder"});
  expect_error(run_stemvo({"calibrate", sequence_.string(), "--out", folder_ / "no/file.txt"}),
               {"no/file.txt"});
  EXPECT_FALSE(fs::exists(out_));
}

}  // namespace
}  // namespace stemvo
