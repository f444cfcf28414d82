// SPDX-License-Identifier: MIT
#include "dataset/listing.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using dataset::comes_before;
using dataset::list_images;
using dataset::matches_pattern;

TEST(NaturalOrder, NumbersByTheirValue) {
  const std::vector<std::string> sorted = {"0.png",      "1.png",    "2.png",     "10.png",
                                           "a.png",      "a1b2.png", "a1b10.png", "a2b1.png",
                                           "frame2.png", "frame10",  "frame0100"};
  std::vector<std::string> names(sorted.rbegin(), sorted.rend());
  std::sort(names.begin(), names.end(), comes_before);
  EXPECT_EQ(names, sorted);
  EXPECT_TRUE(comes_before("frame2", "frame10"));
  EXPECT_FALSE(comes_before("frame10", "frame2"));
  EXPECT_TRUE(comes_before("1311868169.163498.png", "1311868169.263274.png"));
  EXPECT_TRUE(comes_before("99999999999999999998", "99999999999999999999"));
  EXPECT_TRUE(comes_before("frame02", "frame2")) << "of equals, character by character";
  EXPECT_FALSE(comes_before("frame2", "frame02"));
  EXPECT_TRUE(comes_before("frame02a", "frame2b"));
  EXPECT_TRUE(comes_before("frame", "frame1"));
  EXPECT_TRUE(comes_before("a9", "b1"));
  EXPECT_TRUE(comes_before("000", "1"));
}

TEST(Pattern, StarsAndQuestionMarks) {
  EXPECT_TRUE(matches_pattern("frame_12.png", "*"));
  EXPECT_TRUE(matches_pattern("frame_12.png", "frame_*.png"));
  EXPECT_TRUE(matches_pattern("frame_12.png", "*1*"));
  EXPECT_TRUE(matches_pattern("frame_12.png", "frame_??.png"));
  EXPECT_TRUE(matches_pattern("a.b.png", "*.png"));
  EXPECT_TRUE(matches_pattern("aab", "*ab"));
  EXPECT_TRUE(matches_pattern("frame_12.png", "frame_[0-2][1-3].png"));
  EXPECT_FALSE(matches_pattern("frame_12.png", "frame_[3-9]*"));
  EXPECT_FALSE(matches_pattern("frame_12.png", "frame_?.png"));
  EXPECT_FALSE(matches_pattern("frame_12.png", "right_*"));
  EXPECT_FALSE(matches_pattern("frame_12.png", "*.jpg"));
  EXPECT_FALSE(matches_pattern("frame", "frame?"));
}

class ImageList : public ::testing::Test {
 protected:
  void touch(const std::string& name) const { (void)folder_.file(name, "x"); }
  static std::vector<std::string> names(const fs::path& path) {
    const auto list = list_images(path);
    std::vector<std::string> result;
    if (list) {
      for (const fs::path& file : list->files) {
        result.push_back(file.filename().string());
      }
    }
    return result;
  }
  static std::string error_of(const fs::path& path) { return message_of(list_images(path)); }
  TempFolder folder_;
};

TEST_F(ImageList, ImagesOfAFolderInTheirOrder) {
  for (const char* name : {"f10.png", "f2.JPG", "f1.jpeg", "notes.txt", ".f0.png", "._f2.jpg"}) {
    touch(name);
  }
  fs::create_directories(folder_ / "f3.png");
  EXPECT_THAT(names(folder_.path()), ElementsAre("f1.jpeg", "f2.JPG", "f10.png"));
  EXPECT_THAT(names(folder_.path() / ""), ElementsAre("f1.jpeg", "f2.JPG", "f10.png"));
}

TEST_F(ImageList, ImagesOfAPattern) {
  for (const char* name : {"left_10.png", "left_9.png", "right_9.png", "left_8.txt"}) {
    touch(name);
  }
  EXPECT_THAT(names(folder_ / "left_*"), ElementsAre("left_9.png", "left_10.png"));
  EXPECT_THAT(names(folder_ / "*_?.png"), ElementsAre("left_9.png", "right_9.png"));
  EXPECT_THAT(names(folder_ / "[l-m]*_[8-9].png"), ElementsAre("left_9.png"));
  EXPECT_THAT(error_of(folder_ / "up_*.png"), HasSubstr("up_*.png: expected images"));
}

TEST_F(ImageList, AFolderWhoseNameHasWildcardsIsAFolder) {
  fs::create_directories(folder_ / "what?");
  (void)folder_.file("what?/a.png", "x");
  EXPECT_THAT(names(folder_ / "what?"), ElementsAre("a.png"));
  EXPECT_THAT(names(folder_ / "what?" / "*.png"), ElementsAre("a.png"));
}

TEST_F(ImageList, Problems) {
  EXPECT_THAT(error_of(folder_ / "none"), HasSubstr("none: expected a folder of images"));
  EXPECT_THAT(error_of(folder_ / "none" / "*.png"), HasSubstr("none: expected a folder of images"));
  EXPECT_THAT(error_of(folder_ / "*" / "a.png"),
              HasSubstr("expected *, ? and [..] in the last part"));
  EXPECT_THAT(error_of(folder_ / "*" / "*.png"),
              HasSubstr("expected *, ? and [..] in the last part"));
  EXPECT_THAT(error_of(folder_.path()), HasSubstr("expected images (.png, .jpg, .jpeg), found"));
  EXPECT_THAT(error_of(folder_.file("a.png", "x")), HasSubstr("expected a folder of images"));
}

}  // namespace
}  // namespace stemvo
