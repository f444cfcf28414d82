// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include "mapping/map_keeper.hpp"
#include "support/small_map.hpp"

namespace stemvo {
namespace {

TEST(MapKeeper, PutsAnotherRecordingsFramesTimesAndTracksBeforeItsOwn) {
  MapKeeper keeper;
  for (int i = 0; i < 2; ++i) {
    keeper.load(i == 0 ? testing::small_map().map : keeper.map());
    const KeptMap& map = keeper.map();
    EXPECT_EQ(map.keyframes[0].frame, -7);
    EXPECT_EQ(map.keyframes[1].frame, -2) << "-1 is none";
    EXPECT_LT(map.keyframes[1].time_s, -100.0);
    EXPECT_EQ(map.keyframes[1].time_s - map.keyframes[0].time_s, 0.5);
    EXPECT_EQ(map.keyframes[0].corners[0].track_id, -6);
    EXPECT_EQ(map.keyframes[0].corners[1].track_id, -2);
    EXPECT_EQ(map.loops.size(), 1U);
  }
  EXPECT_FALSE(keeper.has_own(0));
  EXPECT_EQ(keeper.map_from_world().scale, 1.0) << "it is not known where the world lies in it";
}

}  // namespace
}  // namespace stemvo
