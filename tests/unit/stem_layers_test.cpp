// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "models/manifest.hpp"
#include "stem/stem.hpp"
#include "support/temp_folder.hpp"
#include "support/tiny_stem.hpp"

namespace stemvo {
namespace {

using ::testing::HasSubstr;

StemOptions layer_options(const std::string& model,
                          const std::string& layer,
                          int sampling_px = 0,
                          int filter = -1) {
  StemOptions options;
  options.model = model;
  options.layer = layer;
  options.sampling_px = sampling_px;
  options.filter = filter;
  return options;
}

TEST(StemLayers, EachLayerHasItsOwnFiltersAndPixelMap) {
  const testing::TempFolder folder;
  testing::write_two_layers(folder);
  const auto layers = find_layers("two", folder.path());
  ASSERT_TRUE(layers) << layers.error().message;
  ASSERT_EQ(layers->size(), 2U);
  EXPECT_EQ(layers->front().layer, "stem");
  EXPECT_EQ(layers->back().num_filters, 2);

  const cv::Mat frame = testing::textured_frame({96, 64}, CV_8UC3);
  const auto expected = testing::reference_channels(testing::kPlain4, frame, 4);
  const auto first = create_stem(layer_options("two", "first", 4), folder.path());
  ASSERT_TRUE(first) << first.error().message;
  EXPECT_EQ(first->info().layer, "stem");
  EXPECT_LE(testing::relative_error(first->apply_all(frame)->at(2).values, expected[2]), 1e-5);

  const auto deep = create_stem(layer_options("two", "deep"), folder.path());
  ASSERT_TRUE(deep) << deep.error().message;
  EXPECT_EQ(deep->info().sampling_px, 4);
  const auto channel = deep->apply_range(frame, 0, 1);
  ASSERT_TRUE(channel) << channel.error().message;
  ASSERT_EQ(channel->size(), 1U);
  EXPECT_EQ(channel->front().map.to_input({5, 5}), Eigen::Vector2d(21.5, 21.5));
  const cv::Mat1f values = channel->front().values;
  EXPECT_NEAR(values(5, 6), cv::mean(expected[0](cv::Rect(5, 4, 3, 3)))[0], 1e-3);
}

TEST(StemLayers, RefusesUnknownLayersAndDenserSampling) {
  const testing::TempFolder folder;
  testing::write_two_layers(folder);
  const auto error_of = [&](const StemOptions& options) {
    const auto stem = create_stem(options, folder.path());
    return stem ? "no error" : stem.error().message;
  };
  EXPECT_EQ(error_of(layer_options("two", "top")),
            "two: stem.layer: expected one of stem, deep, found 'top'");
  EXPECT_EQ(error_of(layer_options((folder / "two_layers.onnx").string(), "deep")), "no error");
  EXPECT_THAT(error_of(layer_options("two", "deep", 2)),
              HasSubstr("stem.sampling_px: expected 4 for layer deep"));
  EXPECT_THAT(error_of(layer_options("two", "deep", 0, 2)),
              HasSubstr("expected 0 to 1 for two layer deep, found 2"));
  EXPECT_THAT(error_of(layer_options("gray", "deep")),
              HasSubstr("stem.layer: expected none for gray, found 'deep'"));
}

/// Of loading the deep layer with one word of its manifest changed.
std::string error_with(const std::string& word, const std::string& instead) {
  const testing::TempFolder folder;
  testing::write_two_layers(folder);
  std::string text = testing::read_all(folder / "manifest.yaml");
  (void)folder.file("manifest.yaml", text.replace(text.find(word), word.size(), instead));
  const auto stem = create_stem(layer_options("two", "deep"), folder.path());
  return stem ? "no error" : stem.error().message;
}

TEST(StemLayers, ALayerThatSeesTheWholeFrameIsRefusedForDenseSampling) {
  EXPECT_THAT(error_with("native", "any"), HasSubstr("found that pixels outside it matter"));
}

TEST(StemLayers, SizesAreHeldAgainstTheManifestEvenAtTheNativeStride) {
  EXPECT_THAT(error_with("[12, 12]", "[17, 17]"), HasSubstr("expected channels of"));
}

}  // namespace
}  // namespace stemvo
