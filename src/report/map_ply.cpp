// SPDX-License-Identifier: MIT
#include "report/map_ply.hpp"

#include <bit>
#include <string>

#include <fmt/format.h>

#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

static_assert(std::endian::native == std::endian::little, "as the file");

template <typename Number>
void append(Number number, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
}

void append_vertex(const ColoredPoint& point, std::string& bytes) {
  for (const float coordinate : point.position) {
    append(coordinate, bytes);
  }
  bytes.append(point.rgb.begin(), point.rgb.end());
}

std::string header(std::size_t num_vertices, std::size_t num_edges) {
  return fmt::format(
      "ply\n"
      "format binary_little_endian 1.0\n"
      "comment stemvo {}: x right, y down, z forward of the first camera\n"
      "element vertex {}\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element edge {}\n"
      "property int vertex1\nproperty int vertex2\n"
      "end_header\n",
      version(), num_vertices, num_edges);
}

}  // namespace

Status write_map_ply(const std::filesystem::path& file,
                     std::span<const ColoredPoint> points,
                     std::span<const Rigid3> world_from_camera) {
  std::string vertices;
  std::size_t num_points = 0;
  for (const ColoredPoint& point : points) {
    if (point.position.allFinite()) {  // a landmark may be as good as infinitely far
      append_vertex(point, vertices);
      ++num_points;
    }
  }
  const std::size_t num_cameras = world_from_camera.size();
  for (const Rigid3& pose : world_from_camera) {
    append_vertex({pose.translation.cast<float>(), kMapPathColor}, vertices);
  }
  std::string edges;
  for (std::size_t i = 1; i < num_cameras; ++i) {
    append(static_cast<std::int32_t>(num_points + i - 1), edges);
    append(static_cast<std::int32_t>(num_points + i), edges);
  }
  const std::size_t num_edges = num_cameras > 0 ? num_cameras - 1 : 0;
  return write_text_file(file, header(num_points + num_cameras, num_edges) + vertices + edges);
}

}  // namespace stemvo
