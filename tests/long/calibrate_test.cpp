// SPDX-License-Identifier: MIT
#include "dataset/frame_files.hpp"
#include "support/program_test.hpp"
#include "support/shared_data.hpp"
#include "support/state_runs.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

Camera read_camera(const fs::path& file) { return dataset::read_kitti_camera(file, 2).value(); }

void write_camera(const fs::path& file, double f, double cx, double cy) {
  write_file(file,
             fmt::format("P2: {0:.12e} 0 {1:.12e} 0 0 {0:.12e} {2:.12e} 0 0 0 1 0\n", f, cx, cy));
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
  const Camera truth = read_camera(sequence_ / "calib.txt");
  const std::string wrong = folder_ / "wrong.txt";
  write_camera(wrong, 1.03 * truth.fx_px, truth.cx_px + 4.0, truth.cy_px - 3.0);
  const ProgramResult result = succeeded(calibrate({"--calib", wrong}));
  const Camera found = read_camera(out_);
  EXPECT_NEAR(found.fx_px / truth.fx_px, 1.0, 0.006);
  EXPECT_EQ(found.fx_px, found.fy_px);
  EXPECT_NEAR(found.cx_px, truth.cx_px, 1.0);
  EXPECT_NEAR(found.cy_px, truth.cy_px, 1.0);
  EXPECT_THAT(result.out, AllOf(HasSubstr("focal length"), HasSubstr("sigma"), HasSubstr("k1"),
                                HasSubstr(out_)));
  EXPECT_THAT(result.err, HasSubstr("300/300 frames"));
  std::cout << result.out;
}

TEST_F(Calibrate, ARunUsesTheFileItIsGivenAndNoOther) {
  const fs::path copy = copy_drive(folder_.path(), 12);
  const std::string wrong = folder_ / "wrong.txt";
  const Camera truth = read_camera(copy / "calib.txt");
  write_camera(wrong, 1.1 * truth.fx_px, truth.cx_px, truth.cy_px);
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

TEST_F(Calibrate, WhatIsWrongIsSaid) {
  expect_error(calibrate({"--calib", folder_ / "none.txt"}), 1, {"none.txt"});
  const std::string other = folder_ / "other.txt";
  write_camera(other, 1000.0, 2000.0, 100.0);
  expect_error(calibrate({"--calib", other}), 1, {"other.txt", "620x188", "2000"});
  expect_error(run_stemvo({"run", sequence_.string(), "--out", folder_ / "o", "--calib", other}), 1,
               {"other.txt", "620x188"});
  expect_error(run_stemvo({"calibrate", folder_ / "none", "--out", out_}), 1, {folder_ / "none"});
  expect_error(run_stemvo({"calibrate", sequence_.string(), "--out", folder_.path().string()}), 1,
               {folder_.path().string(), "folder"});
  expect_error(run_stemvo({"calibrate", sequence_.string(), "--out", folder_ / "no/file.txt"}), 1,
               {"no/file.txt"});
  EXPECT_FALSE(fs::exists(out_));
}

}  // namespace
}  // namespace stemvo
