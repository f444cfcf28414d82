// SPDX-License-Identifier: MIT
#include "stemvo/camera.hpp"
#include "support/matchers.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr Camera kCamera{700.0, 710.0, 600.0, 180.0, 1241, 376};

TEST(Camera, ProjectsAsItsMatrix) {
  const Eigen::Vector3d point(1.0, -0.5, 8.0);
  const Eigen::Vector2d expected = (kCamera.matrix() * point).hnormalized();
  EXPECT_THAT(kCamera.project(point), IsNear(expected, 1e-12));
  EXPECT_THAT(kCamera.project(point), IsNear(Eigen::Vector2d(687.5, 135.625), 1e-12));
}

TEST(Camera, NormalizeIsTheInverseOfProject) {
  const Eigen::Vector2d uv(13.25, 300.5);
  EXPECT_THAT(kCamera.project(7.0 * kCamera.normalize(uv).homogeneous()), IsNear(uv, 1e-12));
  EXPECT_THAT(kCamera.normalize({600.0, 180.0}), IsNear(Eigen::Vector2d(0.0, 0.0), 0.0));
}

TEST(Camera, RightOfTheAxisIsRightInTheImageAndDownIsDown) {
  const Eigen::Vector2d uv = kCamera.project({1.0, 1.0, 10.0});
  EXPECT_GT(uv.x(), kCamera.cx_px);
  EXPECT_GT(uv.y(), kCamera.cy_px);
  EXPECT_DOUBLE_EQ(kCamera.mean_focal_px(), 705.0);
}

}  // namespace
}  // namespace stemvo
