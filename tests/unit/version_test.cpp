// SPDX-License-Identifier: MIT
#include "stemvo/version.hpp"

#include <string>

#include <gmock/gmock.h>

namespace stemvo {
namespace {

TEST(Version, IsTheProjectsVersionAndPerhapsACommit) {
  const std::string text(version());
  const std::string number = STEMVO_VERSION;
  EXPECT_EQ(number, std::to_string(STEMVO_VERSION_MAJOR) + "." +
                        std::to_string(STEMVO_VERSION_MINOR) + "." +
                        std::to_string(STEMVO_VERSION_PATCH));
  ASSERT_EQ(text.substr(0, number.size()), number);
  const std::string commit = text.substr(number.size());
  if (!commit.empty()) {
    EXPECT_THAT(commit, testing::MatchesRegex("\\+[0-9a-f]+(\\.dirty)?"));
  }
}

}  // namespace
}  // namespace stemvo
