// SPDX-License-Identifier: MIT
// Maps on disk, as they come and sealed again.
#include "mapping/map_file.hpp"

#include <string_view>

#include "fuzz_input.hpp"

namespace {

using namespace stemvo;

void read_and_use(std::string_view bytes) {
  const fuzz::InputFile file(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  const auto read = read_map_file(file.path());
  fuzz::expect_said(read);
  if (read) {
    for (const Loop& loop : read->map.loops) {
      for (const auto& [from, to] : loop.corners) {
        (void)read->map.keyframes.at(static_cast<std::size_t>(loop.from))
            .corners.at(static_cast<std::size_t>(from));
      }
    }
    (void)place_trajectory(std::vector<Rigid3>(3), std::vector<double>{0.0, 0.1, 0.2}, read->map);
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  read_and_use(bytes);
  constexpr std::size_t kHeaderBytes = 34;  // what is mutated is behind it
  read_and_use(sealed_map(bytes.substr(std::min(kHeaderBytes, size))));
  return 0;
}
