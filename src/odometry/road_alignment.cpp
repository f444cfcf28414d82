// SPDX-License-Identifier: MIT
#include "odometry/road_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace stemvo {

namespace {

constexpr int kMinTileSamples = 20;
/// Residuals beyond the pictures' own standard deviation count linearly.
constexpr float kHuber = 1.0F;

double correlation_of(double cc, double pp, double cp) {
  return cc > 0.0 && pp > 0.0 ? cp / std::sqrt(cc * pp) : 0.0;
}

/// Walks over the samples; `visit(sample, ray, point in prev, interpolated prev, cur value)`.
template <typename Visit>
void for_each_match(const RoadPicture::Level& prev,
                    const RoadPicture::Level& cur,
                    const std::vector<RoadRegion::Sample>& samples,
                    const RoadWarp& warp,
                    const Visit& visit) {
  const Camera& camera = cur.camera;
  const Eigen::Matrix3f rotation = warp.rotation().cast<float>();
  const Eigen::Vector3f translation = warp.translation.cast<float>();
  const Eigen::Vector3f plane = warp.plane.cast<float>();
  // RoadWarp::inverse_depth(), written out.
  const auto bend = static_cast<float>(4.0 * warp.drop * warp.plane.squaredNorm());
  const auto fx = static_cast<float>(camera.fx_px);
  const auto fy = static_cast<float>(camera.fy_px);
  const auto cx = static_cast<float>(camera.cx_px);
  const auto cy = static_cast<float>(camera.cy_px);
  const auto first_row = static_cast<float>(prev.first_row);
  const auto last_u = static_cast<float>(prev.values.cols - 2);
  const auto last_v = static_cast<float>(prev.values.rows - 2);
  const auto stride = static_cast<std::ptrdiff_t>(prev.values.step1());
  for (const RoadRegion::Sample& sample : samples) {
    const Eigen::Vector3f ray((static_cast<float>(sample.u) - cx) / fx,
                              (static_cast<float>(sample.v) - cy) / fy, 1.0F);
    const float flat = plane.dot(ray);
    const float root = 1.0F - bend / (flat * flat);
    if (!(flat > 0.0F && root > static_cast<float>(kMinRoadRoot))) {
      continue;  // behind a crest
    }
    const Eigen::Vector3f p =
        rotation * ray + (0.5F * flat * (1.0F + std::sqrt(root))) * translation;
    const float u = fx * p.x() / p.z() + cx;
    const float v = fy * p.y() / p.z() + cy - first_row;
    if (!(p.z() > 1e-3F && u >= 1.0F && v >= 1.0F && u < last_u && v < last_v)) {
      continue;
    }
    const int iu = static_cast<int>(u);
    const int iv = static_cast<int>(v);
    const float a = u - static_cast<float>(iu);
    const float b = v - static_cast<float>(iv);
    const float* top = prev.values.ptr<float>(iv) + 4 * static_cast<std::ptrdiff_t>(iu);
    using Map = Eigen::Map<const Eigen::Array4f>;
    const Eigen::Array4f upper = Map(top) + a * (Map(top + 4) - Map(top));
    const Eigen::Array4f lower =
        Map(top + stride) + a * (Map(top + stride + 4) - Map(top + stride));
    const Eigen::Array4f value = upper + b * (lower - upper);
    visit(
        sample, ray, p, value,
        cur.values.ptr<float>(sample.v - cur.first_row)[4 * static_cast<std::ptrdiff_t>(sample.u)]);
  }
}

}  // namespace

double RoadTile::correlation() const {
  return num_samples < kMinTileSamples ? 0.0 : correlation_of(cur_cur, prev_prev, cur_prev);
}

double RoadTile::noise() const {
  return (cur_cur + prev_prev - 2.0 * cur_prev) / std::max(1, num_samples);
}

RoadTiles align_road(const RoadPicture::Level& prev,
                     const RoadPicture::Level& cur,
                     const std::vector<RoadRegion::Sample>& samples,
                     const RoadWarp& warp) {
  RoadTiles tiles;
  const Eigen::Vector3f t = warp.translation.cast<float>();
  const Eigen::Vector3f plane = warp.plane.cast<float>();
  const auto bend_unit = static_cast<float>(warp.plane.squaredNorm());
  const auto fx = static_cast<float>(cur.camera.fx_px);
  const auto fy = static_cast<float>(cur.camera.fy_px);
  for_each_match(prev, cur, samples, warp,
                 [&](const RoadRegion::Sample& sample, const Eigen::Vector3f& ray,
                     const Eigen::Vector3f& p, const Eigen::Array4f& value, float cur_value) {
                   RoadTile& tile = tiles[static_cast<std::size_t>(sample.tile)];
                   tile.cur_cur += cur_value * cur_value;
                   tile.prev_prev += value[0] * value[0];
                   tile.cur_prev += cur_value * value[0];
                   ++tile.num_samples;
                   // Gradient of the previous picture along the point p: g = grad . dpi/dp.
                   const float gx = value[1] * fx / p.z();
                   const float gy = value[2] * fy / p.z();
                   const Eigen::Vector3f g(gx, gy, -(gx * p.x() + gy * p.y()) / p.z());
                   const float along = g.dot(t);
                   Eigen::Matrix<float, 8, 1> a;
                   a.head<3>() = along * ray;
                   a[3] = -along * bend_unit / plane.dot(ray);
                   a.segment<3>(4) = p.cross(g);  // of exp(w) p
                   a[7] = value[0] - cur_value;
                   const float size = std::abs(a[7]);
                   const float weight = size <= kHuber ? 1.0F : kHuber / size;
                   tile.sums.noalias() += (weight * a) * a.transpose();
                 });
  return tiles;
}

double correlate_road(const RoadPicture::Level& prev,
                      const RoadPicture::Level& cur,
                      const std::vector<RoadRegion::Sample>& samples,
                      const RoadWarp& warp) {
  double cc = 0.0;
  double pp = 0.0;
  double cp = 0.0;
  std::size_t count = 0;
  for_each_match(prev, cur, samples, warp,
                 [&](const RoadRegion::Sample&, const Eigen::Vector3f&, const Eigen::Vector3f&,
                     const Eigen::Array4f& value, float cur_value) {
                   cc += cur_value * cur_value;
                   pp += value[0] * value[0];
                   cp += cur_value * value[0];
                   ++count;
                 });
  // A warp that leaves the picture with all but a few samples has proven nothing.
  return 2 * count < samples.size() ? 0.0 : correlation_of(cc, pp, cp);
}

}  // namespace stemvo
