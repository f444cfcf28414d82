// SPDX-License-Identifier: MIT
#include "dataset/file_bytes.hpp"

#include <fstream>
#include <system_error>

#include <fmt/format.h>

namespace stemvo::dataset {

Expected<Bytes> read_bytes(const std::filesystem::path& file, std::string_view expected) {
  std::error_code code;
  std::ifstream stream(file, std::ios::binary);
  if (!stream || std::filesystem::is_directory(file, code)) {
    return fail(fmt::format("{}: expected a readable {}, cannot open it", file.string(), expected));
  }
  const std::uintmax_t size = std::filesystem::file_size(file, code);
  Bytes bytes(code ? 0 : size);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  return bytes;
}

}  // namespace stemvo::dataset
