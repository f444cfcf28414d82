// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "support/program_test.hpp"

namespace stemvo {

/// Lines of a file that are whole.
inline std::size_t count_lines(const fs::path& file) {
  const std::string text = read_file(file);
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

/// `stemvo search` over a small rendered drive.
class Search : public ::testing::Test {
 protected:
  using Words = std::vector<std::string>;

  [[nodiscard]] Words command(const std::string& out, const Words& more) const {
    Words words = {"search", sequence_.string(), "--out", folder_ / out, "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  [[nodiscard]] ProgramResult search(const std::string& out, const Words& more) const {
    return run_stemvo(command(out, more));
  }
  [[nodiscard]] std::string table(const std::string& out) const {
    return read_file(folder_ / (out + "/filters.csv"));
  }
  [[nodiscard]] nlohmann::json result(const std::string& out) const {
    return nlohmann::json::parse(read_file(folder_ / (out + "/filters.json")));
  }
  /// The drive in a folder of the test's own, to be broken.
  void copy_sequence(const std::string& name = "00") {
    const fs::path drive = test::rendered_drive(kSize);
    fs::create_directories(folder_ / "kitti/sequences");
    fs::create_directories(folder_ / "kitti/poses");
    fs::copy(drive / "sequences/00", folder_ / ("kitti/sequences/" + name),
             fs::copy_options::recursive);
    fs::copy_file(drive / "poses/00.txt", folder_ / ("kitti/poses/" + name + ".txt"));
    sequence_ = folder_ / ("kitti/sequences/" + name);
  }

  static constexpr test::DriveSize kSize = {.frames = 30, .width_px = 310, .height_px = 94};

  TempFolder folder_;
  fs::path sequence_ = test::rendered_drive(kSize) / "sequences/00";
};

}  // namespace stemvo
