// SPDX-License-Identifier: MIT
// What `run --resume` goes on from, behind its checksum, with the odometry's state in it.
#include "pipeline/checkpoint.hpp"

#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <libdeflate.h>
#include <opencv2/core.hpp>

#include "checkpoint_odometry.hpp"
#include "fuzz_input.hpp"

namespace {

/// To the next frame. What is thrown the program tells as damage.
void go_on(stemvo::PhasedOdometry& odometry) {
  cv::Mat image(48, 64, CV_8UC1);
  cv::randu(image, 0, 256);
  try {
    odometry.localize();
    static_cast<void>(odometry.optimize());
    static_cast<void>(odometry.process(odometry.prepare(image)));
    static_cast<void>(odometry.frames().estimator().refined_trajectory());
    static_cast<void>(odometry.frames().estimator().landmarks());
  } catch (const std::logic_error&) {  // NOLINT
  } catch (const cv::Exception&) {     // NOLINT
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const std::string text =
      fmt::format("stemvo checkpoint {:08x}\n{}", libdeflate_crc32(0, data, size),
                  std::string(data, data + size));
  const fuzz::InputFile file(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  const auto read = pipeline::read_checkpoint(file.path(), fuzz::kIdentity, fuzz::kNumFrames);
  fuzz::expect_said(read);
  if (read && *read) {
    PhasedOdometry odometry = fuzz::small_odometry();
    const Status restored = odometry.set_state((*read)->odometry);
    fuzz::expect_said(restored);
    if (restored) {
      go_on(odometry);
    }
  }
  return 0;
}
