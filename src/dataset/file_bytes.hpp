// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include "stemvo/error.hpp"

namespace stemvo::dataset {

using Bytes = std::vector<std::uint8_t>;

/// The whole file. Error: cannot be opened; `expected` is what it should be, e.g. "PNG image".
[[nodiscard]] Expected<Bytes> read_bytes(const std::filesystem::path& file,
                                         std::string_view expected);

}  // namespace stemvo::dataset
