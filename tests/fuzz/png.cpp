// SPDX-License-Identifier: MIT
// The PNG decoder against libpng: the same pixels, or it refuses. Bytes that are no PNG tell how
// to build one: a mutation of a whole file does not get past its checksums and compression.
#include "io/png.hpp"

#include <fuzzer/FuzzedDataProvider.h>
#include <libdeflate.h>
#include <opencv2/core.hpp>

#include "fuzz_input.hpp"

namespace {

std::string be32(std::size_t value) {
  const std::uint32_t bytes = __builtin_bswap32(static_cast<std::uint32_t>(value));
  return {reinterpret_cast<const char*>(&bytes), sizeof(bytes)};
}

std::string build_png(FuzzedDataProvider input) {
  std::string file = "\x89PNG\r\n\x1a\n";
  const auto one_in = [&](int n) { return input.ConsumeIntegralInRange(1, n) == n; };
  const auto add = [&](const std::string& type, const std::string& data) {
    const std::string checked = type + data;
    const std::uint32_t checksum = libdeflate_crc32(0, checked.data(), checked.size());
    file += be32(data.size()) + checked + be32(one_in(64) ? ~checksum : checksum);
  };
  const auto add_any = [&] {
    while (one_in(8)) {
      add(input.PickValueInArray({"tEXt", "gAMA", "PLTE", "tRNS", "bKGD", "IHDR", "IDAT", "IEND"}),
          input.ConsumeRandomLengthString(32));
    }
  };
  const auto [color, channels] = input.PickValueInArray<std::pair<char, unsigned>>(
      {{0, 1}, {2, 3}, {3, 1}, {4, 2}, {6, 4}, {1, 1}});
  const auto depth = input.PickValueInArray<std::uint8_t>({8, 8, 8, 1, 2, 4, 16, 3});
  const auto cols = input.ConsumeIntegralInRange(0U, 40U);
  const auto rows = input.ConsumeIntegralInRange(0U, 40U);
  std::string pixels;
  for (unsigned row = 1; row <= rows; ++row) {
    const unsigned row_size = 1 + (cols * channels * depth + 7) / 8;
    pixels += input.ConsumeIntegralInRange<char>(0, one_in(64) ? 5 : 4);  // the filter
    pixels += input.ConsumeBytesAsString(row_size - 1);
    pixels.resize(std::size_t{row} * row_size);
  }
  static libdeflate_compressor* const packer = libdeflate_alloc_compressor(1);
  std::string packed(libdeflate_zlib_compress_bound(packer, pixels.size()), '\0');
  packed.resize(
      libdeflate_zlib_compress(packer, pixels.data(), pixels.size(), packed.data(), packed.size()));
  add_any();
  add("IHDR", be32(cols) + be32(rows) + static_cast<char>(depth) + color + '\0' + '\0' +
                  static_cast<char>(one_in(16)));
  add_any();
  const auto half = input.ConsumeIntegralInRange<std::size_t>(0, packed.size());
  add("IDAT", packed.substr(0, half));
  add_any();
  add("IDAT", packed.substr(half));
  add_any();
  add("IEND", one_in(64) ? "more" : "");
  return file;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stemvo;
  const bool is_whole = io::is_png({data, size});
  const std::string file = is_whole ? std::string(data, data + size) : build_png({data, size});
  const io::Bytes bytes(reinterpret_cast<const std::uint8_t*>(file.data()), file.size());
  for (const bool as_color : {false, true}) {
    const auto ours = io::decode_png(bytes, "image", as_color);
    fuzz::expect_said(ours);
    if (ours) {
      const cv::Mat theirs = io::decode_any_png(bytes, as_color);
      fuzz::expect(!theirs.empty(), "libpng takes what we take");
      fuzz::expect(ours->size() == theirs.size() && ours->type() == theirs.type(),
                   "the image is of libpng's size and kind");
      fuzz::expect(cv::norm(*ours, theirs, cv::NORM_INF) == 0.0, "pixels are libpng's");
    }
  }
  return 0;
}
