// SPDX-License-Identifier: MIT
#pragma once

#include "support/run_program.hpp"
#include "support/test.hpp"

namespace stemvo::test {

/// Motion JPEG of images of one size.
inline void write_video(const std::string& file,
                        double rate_hz,
                        const std::vector<std::filesystem::path>& images) {
  succeeded(run_program(STEMVO_WRITE_VIDEO, joined({file, fmt::format("{}", rate_hz)},
                                                   Words(images.begin(), images.end()))));
}

}  // namespace stemvo::test
