// SPDX-License-Identifier: MIT
// A model file, as far as the passes over small images that every foreign model goes through.
#include "fuzz_input.hpp"
#include "stem/model_file.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  StemNetwork network;  // plain_k4s4 of tests/data/make_models.py
  network.name = "plain";
  network.file = file.path();
  network.layer = "stem";
  network.num_filters = 3;
  network.kernel_px = {4, 4};
  network.stride_px = 4;
  fuzz::expect_said(internal::open_model(network));
  return 0;
}
