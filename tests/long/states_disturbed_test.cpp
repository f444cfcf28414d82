// SPDX-License-Identifier: MIT
// Images that show something else than a street that stands still: none, darkness, others.
#include "support/drives.hpp"
#include "support/state_drives.hpp"
#include "support/state_runs.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

class Disturbed : public ::testing::Test {
 protected:
  /// A copy of the drive that may be changed.
  StateDrive copied(const std::string& name, const StateDrive& drive) {
    const fs::path from = rendered_along(name, drive);
    sequence_ = folder_.path() / "sequences" / "00";
    fs::create_directories(sequence_.parent_path());
    fs::copy(from, sequence_, fs::copy_options::recursive);
    num_frames_ = drive.world_from_camera.size();
    return drive;
  }
  [[nodiscard]] fs::path image_file(int frame) const { return sequence_ / image_name(frame); }
  void change(int from, int to, const std::function<void(int, cv::Mat&)>& edit) const {
    for (int i = from; i < to; ++i) {
      cv::Mat image = cv::imread(image_file(i).string(), cv::IMREAD_COLOR);
      ASSERT_FALSE(image.empty());
      edit(i, image);
      ASSERT_TRUE(cv::imwrite(image_file(i).string(), image));
    }
  }
  [[nodiscard]] StateRun run() const {
    StateRun result = run_states(sequence_, "camera_height");
    EXPECT_EQ(result.states.size(), num_frames_);
    return result;
  }

  TempFolder folder_;
  fs::path sequence_;
  std::size_t num_frames_ = 0;
};

/// A thing with a texture of its own that goes from the left to the right: over a third of the
/// image, or `size` of it.
struct Passing {
  cv::Mat texture;
  int first_frame;
  int speed_px;

  Passing(int first, int speed, const cv::Size& image, cv::Size2d size = {4.0 / 9.0, 0.75})
      : first_frame(first), speed_px(speed) {
    texture.create(static_cast<int>(image.height * size.height),
                   static_cast<int>(image.width * size.width), CV_8UC3);
    cv::RNG random(7);
    random.fill(texture, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(texture, texture, {}, 2.0);
    cv::normalize(texture, texture, 20, 230, cv::NORM_MINMAX);
  }
  void draw(int frame, cv::Mat& image) const {
    const int left = (frame - first_frame) * speed_px - texture.cols / 2;
    const int bottom = std::max(image.rows - 4, texture.rows);
    const cv::Rect place(left, bottom - texture.rows, texture.cols, texture.rows);
    const cv::Rect inside = place & cv::Rect({}, image.size());
    if (!inside.empty()) {
      texture(cv::Rect(inside.tl() - place.tl(), inside.size())).copyTo(image(inside));
    }
  }
};

constexpr double kStep_m = kDriveStep_m;
const cv::Size kImage(620, 188);

/// A share of the light left, and the sensor's noise of one gray level.
std::function<void(int, cv::Mat&)> darkened(double light) {
  return [light, random = cv::RNG(3)](int, cv::Mat& image) mutable {
    cv::Mat noise(image.size(), CV_32FC3);
    random.fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
    cv::Mat dark;
    image.convertTo(dark, CV_32FC3, light);
    dark += noise;
    dark.convertTo(image, CV_8UC3);
  };
}

TEST_F(Disturbed, AFewFramesInTheDarkAreLostAndTheDriveGoesOn) {
  const StateDrive drive = copied("steady", steady_drive());
  const int begin = 30;
  const int end = 34;
  change(begin, end, darkened(0.002));
  const StateRun result = run();
  // Two dark frames in a row have the same faint image: tracks between them are no map.
  result.expect_states(begin, end, {"lost", "no_image", "initializing"});
  result.expect_states(end, end + 5, {"lost", "initializing", "tracking"});
  result.expect_states(end + 5, 60, {"tracking"});
  for (int i = begin; i < end; ++i) {
    EXPECT_NE(result.roads[static_cast<std::size_t>(i)], "measured") << i;
  }
  expect_accurate(result.poses, drive, 10, begin, 0.05, 0.3 * kDeg);
  expect_accurate(result.poses, drive, end + 5, 60, 0.05, 0.3 * kDeg);
  // Over the dark too, by what was known before and after.
  expect_accurate(result.poses, drive, begin - 5, begin + 16, 0.1, 2.0 * kDeg, 20);
}

// Five gray levels of contrast under noise of one: contrast normalization makes an image of them.
TEST_F(Disturbed, AFewDimFramesAreFollowed) {
  const StateDrive drive = copied("steady", steady_drive());
  change(30, 34, darkened(0.02));
  const StateRun result = run();
  result.expect_states(30, 60, {"tracking"});
  expect_accurate(result.poses, drive, 10, 60, 0.05, 0.3 * kDeg);
}

TEST_F(Disturbed, WhoStandsStaysWhereHeIsWhateverPassesBy) {
  const StateDrive drive = copied("standing", standing_drive());
  const Passing passing(drive.event_begin + 2, 35, kImage);
  change(drive.event_begin + 2, drive.event_end,
         [&](int i, cv::Mat& image) { passing.draw(i, image); });
  const StateRun result = run();
  result.expect_states(drive.event_begin, drive.event_end, {"stationary"});
  const Rigid3 moved = result.motion(drive.event_begin, drive.event_end - 1);
  EXPECT_LE(moved.translation.norm(), 0.02);  // measured, not held: 0.2 % of a depth of 10 m
  const int num_frames = static_cast<int>(result.poses.size());
  expect_accurate(result.poses, drive, 10, drive.event_begin, 0.05, 0.3 * kDeg);
  expect_accurate(result.poses, drive, drive.event_end + 3, num_frames, 0.05, 0.3 * kDeg);
}

TEST_F(Disturbed, WhoStandsOpensNoMapOnWhatHidesTheWorld) {
  const StateDrive drive = copied("standing", standing_drive());
  const int begin = drive.event_begin + 2;
  const Passing passing(begin, 80, kImage, {1.2, 1.0});
  change(begin, drive.event_end, [&](int i, cv::Mat& image) { passing.draw(i, image); });
  const StateRun result = run();
  const int num_frames = static_cast<int>(result.poses.size());
  result.expect_states(drive.event_begin, num_frames,
                       {"stationary", "lost", "low_parallax", "rotating", "tracking"});
  const Rigid3 moved = result.motion(drive.event_begin, drive.event_end - 1);
  EXPECT_LE(moved.translation.norm(), 0.02);  // 8.4 by a map on what passes
  expect_accurate(result.poses, drive, drive.event_end + 3, num_frames, 0.05, 0.3 * kDeg);
}

TEST_F(Disturbed, WhoDrivesGoesOnWhateverPassesBy) {
  const StateDrive drive = copied("steady", steady_drive());
  const int begin = 15;
  const int end = 45;
  const Passing passing(begin, 26, kImage);
  change(begin, end, [&](int i, cv::Mat& image) { passing.draw(i, image); });
  const StateRun result = run();
  result.expect_states(begin, 60, {"tracking"});
  expect_accurate(result.poses, drive, 10, 60, 0.1, 0.6 * kDeg);
  EXPECT_NEAR((result.poses[40].translation - result.poses[20].translation).norm(), 20 * kStep_m,
              0.05 * 20 * kStep_m);
}

}  // namespace
}  // namespace stemvo
