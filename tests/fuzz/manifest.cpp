// SPDX-License-Identifier: MIT
#include "models/manifest.hpp"

#include "fuzz_input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  const auto models = load_manifest(file.path());
  fuzz::expect_said(models);
  if (models) {
    for (const ModelEntry& model : *models) {
      fuzz::expect(model.default_filter >= 0 && model.default_filter < model.num_filters,
                   "the default filter is one of the model's");
      fuzz::expect(model.stride_px > 0 && model.kernel_px[0] > 0 && model.kernel_px[1] > 0,
                   "kernel and stride are positive");
    }
  }
  return 0;
}
