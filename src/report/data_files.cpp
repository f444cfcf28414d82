// SPDX-License-Identifier: MIT
#include "report/data_files.hpp"

#include <bit>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

constexpr std::string_view kModels[] = {"none", "homography", "essential"};  // by TwoViewModel

/// x, y, z, qx, qy, qz, qw.
std::string pose_columns(const Eigen::Vector3d& t, const Eigen::Quaterniond& q) {
  return fmt::format("{:.9g},{:.9g}", fmt::join(t, ","), fmt::join(q.coeffs(), ","));
}

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

std::string frames_csv_row(std::size_t frame,
                           double timestamp_s,
                           const FrameResult& r,
                           const Rigid3& written) {
  const std::string sigma = r.scale_sigma ? fmt::format("{:.4f}", *r.scale_sigma) : "";
  const auto& sigmas = r.camera_sigma;
  const auto& [map_scale, map_rotation, map_position] = r.map_from_world;
  const Eigen::Matrix<double, 6, 1> variances = r.motion_covariance.diagonal();
  return fmt::format(
      "{},{},{},{},{},{:.3f},{:.3f},{:.4f},{},{:.3f},{:.3f},{:.3f},{},{},{:.2f},{:.2f},{:.2f},{},{}"
      ",{:.9g},{},{},{:d},{},{:.6g},,\n",
      frame, timestamp_s, to_string(r.state), r.num_matches, r.num_inliers, r.homography_score,
      r.fundamental_score, r.homography_ratio, kModels[static_cast<std::size_t>(r.model)],
      r.times.stem_ms, r.times.features_ms, r.times.pose_ms, sigma, to_string(r.scale_state),
      r.camera.fx_px, r.camera.cx_px, r.camera.cy_px,
      sigmas ? fmt::format("{:.2f},{:.2f},{:.2f}", sigmas->fx_px, sigmas->cx_px, sigmas->cy_px)
             : ",,",
      r.recognized_frame == -1 ? "" : fmt::format("{}", r.recognized_frame), map_scale,
      pose_columns(map_position, map_rotation), r.map_id, r.is_scale_new,
      pose_columns(written.translation, written.rotation),
      fmt::join(variances.begin(), variances.end(), ","));
}

std::string frames_csv_with_errors(std::string_view table, std::span<const FrameError> errors) {
  std::string result(kFramesCsvHeader);
  auto error = errors.begin();
  const std::vector<std::string_view> lines = split_lines(table);
  for (std::size_t row = 0; row + 1 < lines.size(); ++row) {
    result += lines[row + 1];
    if (error != errors.end() && error->row == row) {
      result.pop_back();  // the comma between two empty columns
      result += fmt::format("{:.4f},{:.4f}", error->position_m, error->rotation_deg);
      ++error;
    }
    result += '\n';
  }
  return result;
}

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
