// SPDX-License-Identifier: MIT
// Image files by the first bytes: PNG or JPEG.
#include "fuzz_input.hpp"
#include "io/image_file.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const fuzz::InputFile file(data, size);
  const auto kind = io::read_image_kind(file.path());
  fuzz::expect_said(kind);
  for (const bool as_color : {false, true}) {
    const auto image = io::read_image(file.path(), as_color);
    fuzz::expect_said(image);
    fuzz::expect(image.has_value() == kind.has_value(), "an image is whole in gray and in colour");
    fuzz::expect(!image || image->size() == kind->size, "an image has the size that was told");
  }
  return 0;
}
