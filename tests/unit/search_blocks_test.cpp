// SPDX-License-Identifier: MIT
#include <gmock/gmock.h>

#include "search/blocks.hpp"

namespace stemvo::search {
namespace {

using ::testing::ElementsAre;

void add(std::vector<Flight>& flights, std::size_t count, const Flight& one) {
  flights.insert(flights.end(), count, one);
}

std::vector<std::size_t> sizes(const std::vector<std::vector<std::size_t>>& blocks) {
  std::vector<std::size_t> sizes;
  std::size_t next = 0;
  for (const auto& block : blocks) {
    sizes.push_back(block.size());
    for (const std::size_t index : block) {
      EXPECT_EQ(index, next++);  // each once, in order
    }
  }
  return sizes;
}

TEST(Blocks, AWholeLayerWhereMemoryAllows) {
  std::vector<Flight> flights;
  add(flights, 256, {.layer = 0, .pass = 0, .bytes = bytes_in_flight({620, 188}, {620, 188}, 1)});
  EXPECT_THAT(sizes(cut_into_blocks(flights, 0)), ElementsAre(256));
  EXPECT_THAT(sizes(cut_into_blocks(flights, 100)), ElementsAre(100, 100, 56));
}

TEST(Blocks, AreEqualPartsOfALayerThatIsTooLarge) {
  std::vector<Flight> flights;
  add(flights, 10, {.layer = 0, .pass = 0, .bytes = 100});
  EXPECT_THAT(sizes(cut_into_blocks(flights, 0, 1000)), ElementsAre(10));
  EXPECT_THAT(sizes(cut_into_blocks(flights, 0, 999)), ElementsAre(5, 5));
  EXPECT_THAT(sizes(cut_into_blocks(flights, 0, 400)), ElementsAre(3, 3, 4));
  EXPECT_EQ(cut_into_blocks(flights, 0, 1).size(), 10U);  // one is run, whatever it takes
}

TEST(Blocks, OfOnePassRunTogetherAndOthersApart) {
  std::vector<Flight> flights;
  add(flights, 3, {.layer = 0, .pass = 0, .bytes = 100});
  add(flights, 4, {.layer = 1, .pass = 0, .bytes = 100});
  add(flights, 5, {.layer = 2, .pass = 1, .bytes = 100});
  EXPECT_THAT(sizes(cut_into_blocks(flights, 0, 1000)), ElementsAre(7, 5));
  EXPECT_THAT(sizes(cut_into_blocks(flights, 0, 600)), ElementsAre(3, 4, 5));  // no layer is split
  EXPECT_TRUE(cut_into_blocks({}, 0).empty());
}

TEST(Blocks, LargerPicturesAndMoreSequencesTakeMore) {
  const cv::Size half(620, 188);
  const cv::Size full(1241, 376);
  const double mb = 1e-6 * static_cast<double>(bytes_in_flight(half, half, 1));
  EXPECT_GT(mb, 1.7);  // as measured
  EXPECT_LT(mb, 2.1);
  EXPECT_GT(bytes_in_flight(half, full, 1), 3 * bytes_in_flight(half, half, 1));
  EXPECT_GT(bytes_in_flight(half, half, 2), bytes_in_flight(half, half, 1));
}

}  // namespace
}  // namespace stemvo::search
