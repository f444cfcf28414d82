// SPDX-License-Identifier: MIT
// What `run --resume` goes on from, behind its checksum, with the odometry's state in it.
#include "pipeline/checkpoint.hpp"

#include <string>

#include <fmt/format.h>
#include <libdeflate.h>

#include "checkpoint_odometry.hpp"
#include "fuzz_input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const std::string text =
      fmt::format("stemvo checkpoint {:08x}\n{}", libdeflate_crc32(0, data, size),
                  std::string(data, data + size));
  const fuzz::InputFile file(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  const auto read = pipeline::read_checkpoint(file.path(), fuzz::kIdentity, fuzz::kNumFrames);
  fuzz::expect_said(read);
  if (read && *read) {
    static PhasedOdometry odometry = fuzz::small_odometry();
    fuzz::expect_said(odometry.set_state((*read)->odometry));
  }
  return 0;
}
