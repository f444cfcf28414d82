// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "mapping/kept_map.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// A map on disk.
struct MapFile {
  std::string channel;  ///< that descriptors were made on: those of another one are not comparable
  KeptMap map;
};

/// Error: another kind of file, that is not empty, lies there.
[[nodiscard]] Status check_place_of_map(const std::filesystem::path& file);
/// Replaces the file at once. Errors: its place is another's; it cannot be written.
[[nodiscard]] Status write_map_file(const std::filesystem::path& file, MapFile map);
/// The same to the last bit. Errors: the file is missing, no map, of another version, cut or
/// damaged; what it holds contradicts itself: numbers that are not finite, keyframes or corners
/// that are not there or not in order.
[[nodiscard]] Expected<MapFile> read_map_file(const std::filesystem::path& file);

/// A file's bytes around these contents: what they are, and a checksum.
[[nodiscard]] std::string sealed_map(std::string_view contents);

}  // namespace stemvo
