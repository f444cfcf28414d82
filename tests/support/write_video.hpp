// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "support/run_program.hpp"

namespace stemvo::test {

/// Motion JPEG of images of one size.
inline void write_video(const std::string& file,
                        double rate_hz,
                        const std::vector<std::filesystem::path>& images) {
  std::vector<std::string> arguments = {file, fmt::format("{}", rate_hz)};
  arguments.insert(arguments.end(), images.begin(), images.end());
  const ProgramResult result = run_program(STEMVO_WRITE_VIDEO, arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err;
}

}  // namespace stemvo::test
