// SPDX-License-Identifier: MIT
#include "stemvo/two_view.hpp"

#include <utility>

#include <fmt/format.h>

#include "odometry/check_frame.hpp"
#include "odometry/two_view_estimator.hpp"

namespace stemvo {
namespace {

Status check_matches(std::span<const Eigen::Vector2d> prev_uv,
                     std::span<const Eigen::Vector2d> cur_uv) {
  if (prev_uv.size() != cur_uv.size()) {
    return fail(
        fmt::format("matches: expected as many points in one image as in the other, found "
                    "{} and {}",
                    prev_uv.size(), cur_uv.size()));
  }
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    if (!prev_uv[i].allFinite() || !cur_uv[i].allFinite()) {
      return fail(
          fmt::format("matches: expected finite pixels, found ({}, {}) and ({}, {}) in match {}",
                      prev_uv[i].x(), prev_uv[i].y(), cur_uv[i].x(), cur_uv[i].y(), i));
    }
  }
  return {};
}

}  // namespace

Expected<TwoViewResult> estimate_two_view(std::span<const Eigen::Vector2d> prev_uv,
                                          std::span<const Eigen::Vector2d> cur_uv,
                                          const Camera& camera,
                                          const Options& options) {
  Status status = check_camera(camera);
  status = status ? validate(options) : status;
  status = status ? check_matches(prev_uv, cur_uv) : status;
  if (!status) {
    return status.error();
  }
  MeasuredMotion motion =
      TwoViewEstimator(options).measure({prev_uv, cur_uv}, camera, /*is_initializing=*/true);
  return TwoViewResult{motion.state,
                       motion.cur_from_prev,
                       motion.model,
                       motion.homography_ratio,
                       motion.parallax_px,
                       motion.is_decisive,
                       std::move(motion.inlier_mask)};
}

}  // namespace stemvo
