// SPDX-License-Identifier: MIT
#include <gmock/gmock.h>

#include "search/race.hpp"

namespace stemvo::search {
namespace {

using ::testing::ElementsAre;

struct LayerShape {
  std::size_t filters = 0;
  std::size_t max_in_flight = 0;
};

/// The sizes of the blocks of these layers.
std::vector<std::size_t> sizes(const std::vector<LayerShape>& layers, std::size_t block = 0) {
  SearchPlan plan;
  plan.block = block;
  std::vector<std::size_t> all;
  for (const LayerShape& layer : layers) {
    StemOptions gray;
    gray.model = "gray";
    plan.layers.push_back({Config(), Stem::create(gray).value(), layer.max_in_flight});
    for (std::size_t i = 0; i < layer.filters; ++i) {
      all.push_back(plan.candidates.size());
      plan.candidates.push_back({.key = {}, .layer = plan.layers.size() - 1});
    }
  }
  std::vector<std::size_t> sizes;
  std::vector<std::size_t> joined;
  for (const auto& one : cut_into_blocks(plan, all)) {
    sizes.push_back(one.size());
    joined.insert(joined.end(), one.begin(), one.end());
  }
  EXPECT_EQ(joined, all);  // each once, in order
  return sizes;
}

TEST(Blocks, AWholeLayerWhereMemoryAllows) {
  EXPECT_THAT(sizes({{256, 511}}), ElementsAre(256));
  EXPECT_THAT(sizes({{256, 511}}, 100), ElementsAre(100, 100, 56));
  EXPECT_THAT(sizes({{10, 4}}), ElementsAre(4, 4, 2));
  EXPECT_EQ(sizes({{10, 1}}).size(), 10U);
  EXPECT_TRUE(sizes({}).empty());
}

TEST(Blocks, EachIsOfOneLayer) {
  EXPECT_THAT(sizes({{3, 10}, {4, 10}, {5, 4}}), ElementsAre(3, 4, 4, 1));
  EXPECT_THAT(sizes({{3, 10}, {4, 10}}, 3), ElementsAre(3, 3, 1));
}

TEST(Blocks, LargerImagesAndMoreSequencesTakeMore) {
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
