// SPDX-License-Identifier: MIT
// A configuration file, and --set.
#include <string>

#include "config/config.hpp"
#include "fuzz_input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  const auto config = load_config(file.path());
  fuzz::expect_said(config);
  if (config) {
    fuzz::expect_said(validate(*config));  // keys that do not go together
    const std::string text = dump_config(*config);
    const fuzz::InputFile written(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    const auto again = load_config(written.path());
    fuzz::expect(again && dump_config(*again) == text, "a configuration survives its file");
  }
  Config changed;
  fuzz::expect_said(apply_override(changed, std::string(data, data + size)));
  return 0;
}
