// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace stemvo::testing {

/// A PLY file as a viewer reads it: by what its header says, not by what our writer does.
struct PlyFile {
  struct Vertex {
    Eigen::Vector3f position = Eigen::Vector3f::Zero();
    std::array<std::uint8_t, 3> rgb{};
  };
  std::vector<Vertex> vertices;
  std::vector<std::array<std::int32_t, 2>> edges;
};

namespace ply {

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<std::array<std::string, 2>> properties;  ///< type, name
};

inline double read_number(std::istream& in, const std::string& type) {
  const auto get = [&in](auto number) {
    in.read(reinterpret_cast<char*>(&number), sizeof(number));  // x86 and ARM: little endian
    return static_cast<double>(number);
  };
  if (type == "float") {
    return get(0.0F);
  }
  if (type == "uchar") {
    return get(std::uint8_t{0});
  }
  if (type == "int") {
    return get(std::int32_t{0});
  }
  throw std::runtime_error("property of type " + type);
}

inline std::vector<Element> read_header(std::istream& in) {
  std::vector<Element> elements;
  std::string word;
  std::getline(in, word);
  if (word != "ply") {
    throw std::runtime_error("no ply");
  }
  while (in >> word && word != "end_header") {
    if (word == "format") {
      std::string format;
      in >> format;
      if (format != "binary_little_endian") {
        throw std::runtime_error("format " + format);
      }
    } else if (word == "element") {
      Element& element = elements.emplace_back();
      in >> element.name >> element.count;
    } else if (word == "property") {
      auto& property = elements.at(elements.size() - 1).properties.emplace_back();
      in >> property[0] >> property[1];
    }
    std::getline(in, word);
  }
  in.get();  // the newline after end_header
  return elements;
}

}  // namespace ply

/// Throws on a header that does not fit the bytes.
inline PlyFile read_ply(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  PlyFile file;
  for (const ply::Element& element : ply::read_header(in)) {
    for (std::size_t i = 0; i < element.count; ++i) {
      PlyFile::Vertex vertex;
      std::array<std::int32_t, 2> edge{-1, -1};
      for (const auto& [type, name] : element.properties) {
        const double value = ply::read_number(in, type);
        const std::array<std::string, 3> axes{"x", "y", "z"};
        const std::array<std::string, 3> colors{"red", "green", "blue"};
        for (std::size_t k = 0; k < 3; ++k) {
          if (name == axes[k]) {
            vertex.position[static_cast<int>(k)] = static_cast<float>(value);
          } else if (name == colors[k]) {
            vertex.rgb[k] = static_cast<std::uint8_t>(value);
          }
        }
        if (name == "vertex1" || name == "vertex2") {
          edge[name == "vertex1" ? 0 : 1] = static_cast<std::int32_t>(value);
        }
      }
      if (!in) {
        throw std::runtime_error(element.name + ": the file ends early");
      }
      if (element.name == "vertex") {
        file.vertices.push_back(vertex);
      } else if (element.name == "edge") {
        file.edges.push_back(edge);
      }
    }
  }
  if (in.peek() != std::char_traits<char>::eof()) {
    throw std::runtime_error("bytes after the last element");
  }
  return file;
}

}  // namespace stemvo::testing
