// SPDX-License-Identifier: MIT
#include <iterator>

#include <fmt/core.h>

#include "evaluation/trajectory.hpp"
#include "internal_check.hpp"
#include "text/text_file.hpp"

namespace stemvo {

Status write_kitti_trajectory(const std::filesystem::path& file,
                              std::span<const Rigid3> world_from_camera) {
  std::string text;
  for (const Rigid3& pose : world_from_camera) {
    const Matrix34d matrix = pose.matrix();
    for (int i = 0; i < 12; ++i) {
      // + 0.0 turns -0 into 0.
      fmt::format_to(std::back_inserter(text), "{:.12e}{}", matrix(i / 4, i % 4) + 0.0,
                     i == 11 ? '\n' : ' ');
    }
  }
  return write_text_file(file, text);
}

Status write_tum_trajectory(const std::filesystem::path& file,
                            std::span<const double> timestamps_s,
                            std::span<const Rigid3> world_from_camera) {
  STEMVO_CHECK(timestamps_s.size() == world_from_camera.size(), "one timestamp per pose");
  std::string text;
  for (std::size_t i = 0; i < world_from_camera.size(); ++i) {
    const Eigen::Vector3d t = world_from_camera[i].translation.array() + 0.0;
    const Eigen::Array4d q = world_from_camera[i].rotation.coeffs().array() + 0.0;
    fmt::format_to(std::back_inserter(text),
                   "{:.9f} {:.12e} {:.12e} {:.12e} {:.12e} {:.12e} {:.12e} {:.12e}\n",
                   timestamps_s[i], t.x(), t.y(), t.z(), q[0], q[1], q[2], q[3]);
  }
  return write_text_file(file, text);
}

}  // namespace stemvo
