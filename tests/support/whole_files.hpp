// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "support/run_program.hpp"

namespace stemvo::test {

/// Every file under its final name has its end. But for records.jsonl, which grows line by line:
/// there the last one may be cut.
inline void expect_whole_files(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder)) {
    return;
  }
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::filesystem::path& file = entry.path();
    const std::string kind = file.extension().string();
    const std::string bytes = entry.is_regular_file() ? read_file(file) : "";
    if (kind == ".png") {
      EXPECT_FALSE(cv::imread(file.string()).empty()) << file;
      EXPECT_THAT(bytes, ::testing::HasSubstr("IEND")) << file;
    } else if (kind == ".json") {
      EXPECT_TRUE(nlohmann::json::accept(bytes)) << file;
    } else if (kind == ".html") {
      EXPECT_THAT(bytes, ::testing::EndsWith("</html>\n")) << file;
    } else if (kind == ".csv" || kind == ".txt" || kind == ".yaml" || kind == ".md") {
      EXPECT_THAT(bytes, ::testing::EndsWith("\n")) << file;
    }
  }
}

}  // namespace stemvo::test
