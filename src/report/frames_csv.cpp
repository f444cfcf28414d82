// SPDX-License-Identifier: MIT
#include "report/frames_csv.hpp"

#include <fmt/format.h>

namespace stemvo {

namespace {

constexpr std::string_view kHeader =
    "frame,timestamp_s,state,matches,inliers,s_h,s_f,r_h,model,stem_ms,features_ms,pose_ms,"
    "scale_sigma,scale_state,fx_px,cx_px,cy_px,fx_sigma_px,cx_sigma_px,cy_sigma_px,"
    "recognized_frame,map_scale,map_x,map_y,map_z,map_qx,map_qy,map_qz,map_qw,"
    "map_id,is_scale_new\n";

constexpr std::string_view kModels[] = {"none", "homography", "essential"};  // by TwoViewModel

std::string correction(const Similarity3& map_from_world) {
  const auto& [scale, q, t] = map_from_world;
  return fmt::format("{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}", scale, t.x(), t.y(),
                     t.z(), q.x(), q.y(), q.z(), q.w());
}

}  // namespace

std::string_view frames_csv_header() { return kHeader; }

std::string frames_csv_row(std::size_t frame, double timestamp_s, const FrameResult& r) {
  const std::string sigma = r.scale_sigma ? fmt::format("{:.4f}", *r.scale_sigma) : "";
  const auto& sigmas = r.camera_sigma;
  return fmt::format(
      "{},{},{},{},{},{:.3f},{:.3f},{:.4f},{},{:.3f},{:.3f},{:.3f},{},{},{:.2f},{:.2f},{:.2f},{},{}"
      ",{},{},{:d}\n",
      frame, timestamp_s, to_string(r.state), r.num_matches, r.num_inliers, r.homography_score,
      r.fundamental_score, r.homography_ratio, kModels[static_cast<std::size_t>(r.model)],
      r.times.stem_ms, r.times.features_ms, r.times.pose_ms, sigma, to_string(r.scale_state),
      r.camera.fx_px, r.camera.cx_px, r.camera.cy_px,
      sigmas ? fmt::format("{:.2f},{:.2f},{:.2f}", sigmas->fx_px, sigmas->cx_px, sigmas->cy_px)
             : ",,",
      r.recognized_frame == -1 ? "" : fmt::format("{}", r.recognized_frame),
      correction(r.map_from_world), r.map_id, r.is_scale_new);
}

}  // namespace stemvo
