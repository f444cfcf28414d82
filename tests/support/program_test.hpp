// SPDX-License-Identifier: MIT
#pragma once

#include <nlohmann/json.hpp>

#include "support/drives.hpp"
#include "support/run_program.hpp"
#include "support/test.hpp"

/// For tests of whole programs.
namespace stemvo {

inline void write_file(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

/// Of a run's output folder.
inline nlohmann::json metrics_of(const std::string& out) {
  return nlohmann::json::parse(read_file(out + "/metrics.json"));
}

/// A camera file that says what row P2 of a rendered sequence's calib.txt does.
inline std::string camera_file_of(const fs::path& sequence) {
  const std::string text = read_file(sequence / "calib.txt");
  std::istringstream row(text.substr(text.find("P2:")));
  const Words words{std::istream_iterator<std::string>(row), {}};
  const DriveSize size;
  return fmt::format("resolution: [{}, {}]\nintrinsics: [{}, {}, {}, {}]\ndistortion_model: none\n",
                     size.width_px, size.height_px, words.at(1), words.at(6), words.at(3),
                     words.at(7));
}

/// A copy of rendered frames that each test breaks in its own way, and a folder for results.
class DriveCopy : public ::testing::Test {
 protected:
  explicit DriveCopy(int num_frames = 10) : sequence_(copy_drive(folder_.path(), num_frames)) {}

  TempFolder folder_;
  const fs::path sequence_;
  const std::string out_ = folder_ / "out";
};

/// One line, with the words given, and the exit code; nothing on standard output.
inline void expect_error(const ProgramResult& result, int exit_code, const Words& words) {
  EXPECT_EQ(result.exit_code, exit_code) << result.err;
  EXPECT_THAT(result.out, IsEmpty());
  EXPECT_THAT(result.err, StartsWith("error: "));
  EXPECT_THAT(result.err, Not(HasSubstr("internal")));
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  for (const std::string& word : words) {
    EXPECT_THAT(result.err, HasSubstr(word));
  }
}

}  // namespace stemvo
