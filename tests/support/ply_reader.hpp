// SPDX-License-Identifier: MIT
#pragma once

#include "support/test.hpp"

namespace stemvo::testing {

/// A PLY file of the properties that MapPly.HeaderIsTheOneThatViewersExpect holds.
struct PlyFile {
  struct Vertex {
    Eigen::Vector3f position = Eigen::Vector3f::Zero();
    std::array<std::uint8_t, 3> rgb{};
  };
  std::vector<Vertex> vertices;
  std::vector<std::array<std::int32_t, 2>> edges;
};

/// Throws where counts and bytes do not fit.
inline PlyFile read_ply(const std::filesystem::path& path) {
  const std::string bytes = read_all(path);
  const auto count_of = [&](const std::string& element) {
    return std::stoul(bytes.substr(bytes.find("element " + element + " ") + element.size() + 9));
  };
  PlyFile file;
  file.vertices.resize(count_of("vertex"));
  file.edges.resize(count_of("edge"));
  std::istringstream in(bytes.substr(bytes.find("end_header\n") + 11));
  const auto read = [&](auto* values, std::size_t count) {  // x86 and ARM: little endian
    in.read(reinterpret_cast<char*>(values), static_cast<std::streamsize>(count * sizeof(*values)));
  };
  for (PlyFile::Vertex& vertex : file.vertices) {
    read(vertex.position.data(), 3);
    read(vertex.rgb.data(), 3);
  }
  for (std::array<std::int32_t, 2>& edge : file.edges) {
    read(edge.data(), 2);
  }
  if (!in || in.peek() != std::char_traits<char>::eof()) {
    throw std::runtime_error(path.string() + ": expected as many elements as its header says");
  }
  return file;
}

}  // namespace stemvo::testing
