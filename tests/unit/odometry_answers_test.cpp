// SPDX-License-Identifier: MIT
#include "odometry/event_log.hpp"
#include "stemvo/odometry.hpp"
#include "support/small_drive.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

Odometry create() { return Odometry::create(small_frames().camera).value(); }

FrameResult process(Odometry& odometry, std::size_t i) {
  const SmallFrames& frames = small_frames();
  return odometry.process(frames.images[i], frames.order, frames.time_s(i)).value();
}

/// A map that follows the changes of every few frames.
struct Follower {
  void follow(const Odometry& odometry) {
    const MapChanges changes = odometry.landmarks_since(version);
    for (const int id : changes.removed) {
      places.erase(id);
    }
    for (const MapLandmark& landmark : changes.landmarks) {
      places[landmark.id] = landmark.position;
    }
    num_removed += changes.removed.size();
    version = changes.version;
  }

  std::map<int, Eigen::Vector3d> places;
  std::size_t num_removed = 0;
  int version = 0;
};

TEST(OdometryAnswers, WhoFollowsTheChangesHasTheWholeMap) {
  Odometry odometry = create();
  Follower every_frame;
  Follower every_fifth;
  for (std::size_t i = 0; i < small_frames().images.size(); ++i) {
    process(odometry, i);
    every_frame.follow(odometry);
    if (i % 5 == 0) {
      every_fifth.follow(odometry);
    }
    const MapChanges all = odometry.landmarks_since(0);
    std::set<int> ids;
    for (const MapLandmark& landmark : all.landmarks) {
      ASSERT_TRUE(every_frame.places.contains(landmark.id)) << i;
      EXPECT_EQ(every_frame.places.at(landmark.id), landmark.position) << i;
      ids.insert(landmark.id);
    }
    EXPECT_EQ(ids.size(), all.landmarks.size()) << "an id twice";
    EXPECT_EQ(ids.size(), every_frame.places.size()) << i;
  }
  every_fifth.follow(odometry);
  EXPECT_EQ(every_fifth.places, every_frame.places);
  EXPECT_GT(every_frame.places.size(), 50U);
  EXPECT_GT(every_frame.num_removed, 0U);
  const int version = odometry.landmarks_since(0).version;
  EXPECT_THAT(odometry.landmarks_since(version).landmarks, IsEmpty());
  EXPECT_THAT(odometry.landmarks_since(version).removed, IsEmpty());
}

TEST(OdometryAnswers, KeyframesAreFramesWithTheirTimesAndPoses) {
  Odometry odometry = create();
  std::vector<FrameResult> results;
  std::vector<MapKeyframe> followed;
  for (std::size_t i = 0; i < small_frames().images.size(); ++i) {
    results.push_back(process(odometry, i));
    for (const MapKeyframe& keyframe : odometry.keyframes(static_cast<int>(followed.size()))) {
      followed.push_back(keyframe);
    }
  }
  ASSERT_GT(followed.size(), 8U) << "some have left the window";
  EXPECT_EQ(followed.size(), odometry.keyframes().size());
  for (std::size_t id = 0; id < followed.size(); ++id) {
    const auto frame = static_cast<std::size_t>(followed[id].frame);
    EXPECT_EQ(followed[id].id, static_cast<int>(id));
    EXPECT_TRUE(id == 0 || followed[id - 1].frame < followed[id].frame);
    EXPECT_EQ(followed[id].time_s, results[frame].time_s);
    EXPECT_EQ(followed[id].world_from_camera.matrix(), results[frame].world_from_camera.matrix());
  }
}

TEST(OdometryAnswers, AfterAResetAllIsAsNew) {
  Odometry used = create();
  for (std::size_t i = 12; i < 20; ++i) {
    process(used, i);
  }
  used.reset();
  EXPECT_THAT(used.tracked_points(), IsEmpty());
  EXPECT_THAT(used.keyframes(), IsEmpty());
  EXPECT_EQ(used.landmarks_since(0).version, 0);
  Odometry fresh = create();
  for (std::size_t i = 0; i < 10; ++i) {
    const FrameResult expected = process(fresh, i);
    const FrameResult found = process(used, i);
    EXPECT_EQ(found.state, expected.state);
    EXPECT_EQ(found.world_from_camera.matrix(), expected.world_from_camera.matrix());
    EXPECT_EQ(found.camera.cx_px, expected.camera.cx_px);
  }
}

TEST(OdometryAnswers, OneThatWasMovedFromIsAnErrorOrEmpty) {
  Odometry odometry = create();
  process(odometry, 0);
  Odometry other = std::move(odometry);
  EXPECT_THAT(message_of(odometry.process(small_frames().images[1], PixelOrder::kGray, 9.0)),
              HasSubstr("moved from"));
  odometry.reset();
  odometry.set_log({});
  EXPECT_TRUE(odometry.channel_image().empty());
  EXPECT_THAT(odometry.tracked_points(), IsEmpty());
  EXPECT_THAT(odometry.keyframes(), IsEmpty());
  EXPECT_THAT(odometry.landmarks_since(0).landmarks, IsEmpty());
  process(other, 1);
}

TEST(OdometryAnswers, TheLogSaysWhenTheMapWasOpened) {
  Odometry odometry = create();
  std::vector<std::string> lines;
  odometry.set_log([&](LogLevel level, const std::string& line) {
    EXPECT_EQ(level, LogLevel::kInfo);
    lines.push_back(line);
  });
  for (std::size_t i = 0; i < 10; ++i) {
    process(odometry, i);
  }
  EXPECT_THAT(lines, ElementsAre(HasSubstr("a map was opened")));
}

TEST(EventLog, SaysWhatChangesAndOnlyThen) {
  std::vector<std::string> lines;
  EventLog log;
  log.set([&](LogLevel level, const std::string& line) {
    lines.push_back((level == LogLevel::kWarning ? "warning " : "") + line);
  });
  double time_s = 0.0;
  const auto see = [&](FrameState state, ScaleState scale, const char* problem = "",
                       std::string_view road = "") {
    FrameResult result;
    result.state = state;
    result.time_s = time_s++;
    result.scale_state = scale;
    result.problem = problem;
    result.road_reason = road;
    log.observe(result);
    return std::exchange(lines, {});
  };
  using enum FrameState;
  using enum ScaleState;
  EXPECT_THAT(see(kFirst, kNone), IsEmpty());
  EXPECT_THAT(see(kInitializing, kNone), IsEmpty());
  EXPECT_THAT(see(kTracking, kNone), ElementsAre("2.000 s: a map was opened"));
  EXPECT_THAT(see(kTracking, kMeasured), ElementsAre(HasSubstr("believed: lengths are metres")));
  EXPECT_THAT(see(kStationary, kHeld), IsEmpty());
  EXPECT_THAT(see(kLost, kHeld), ElementsAre(HasSubstr("warning 5.000 s: lost")));
  EXPECT_THAT(see(kLost, kHeld), IsEmpty());
  EXPECT_THAT(see(kTracking, kHeld), ElementsAre(HasSubstr("recovered")));
  EXPECT_THAT(see(kLost, kHeld).size(), 1U);
  EXPECT_THAT(see(kInitializing, kNone), ElementsAre(HasSubstr("warning 9.000 s: the scale is")));
  EXPECT_THAT(see(kTracking, kNone), ElementsAre(HasSubstr("a new map was opened")));
  EXPECT_THAT(see(kNoImage, kNone, "too small"), ElementsAre("warning 11.000 s: too small"));
  EXPECT_THAT(see(kNoImage, kNone, "too small"), IsEmpty());
  EXPECT_THAT(see(kTracking, kNone, "", kRoadContradicted), ElementsAre(HasSubstr("contradict")));
  EXPECT_THAT(see(kTracking, kNone, "", kRoadContradicted), IsEmpty());
}

/// The poses where times begin at `first_s`, with a speed between frames.
std::vector<FrameResult> run_from(double first_s) {
  const SmallFrames& frames = small_frames();
  Odometry odometry = Odometry::create(frames.camera).value();
  std::vector<FrameResult> results;
  for (std::size_t i = 0; i < frames.images.size(); ++i) {
    const double time_s = first_s + frames.time_s(i);
    EXPECT_TRUE(odometry.add_speed(time_s - 0.03, 8.0, 0.2));
    results.push_back(odometry.process(frames.images[i], frames.order, time_s).value());
    EXPECT_EQ(results.back().time_s, time_s);
  }
  return results;
}

TEST(FrameClock, SecondsSince1970GiveTheSamePath) {
  const std::vector<FrameResult> expected = run_from(0.0);
  const std::vector<FrameResult> found = run_from(1'764'172'412.789);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(found[i].world_from_camera.matrix(), expected[i].world_from_camera.matrix()) << i;
    EXPECT_EQ(found[i].scale_sigma, expected[i].scale_sigma) << i;
  }
}

}  // namespace
}  // namespace stemvo
