// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "geometry/median.hpp"
#include "odometry/road/model.hpp"
#include "odometry/road/region.hpp"

namespace stemvo {
namespace {

constexpr int kMinPoints = 12;
constexpr int kFitIterations = 8;
constexpr double kTukey = 4.0;         ///< standard deviations
constexpr double kMinNoise_px = 0.05;  ///< no track is better than this; input pixels
/// Wide and flat: texture on the road is stretched across the image.
const cv::Size kWindowReach(15, 7);  ///< to either side; input pixels, as all lengths here
const cv::Size kCell(48, 24);
constexpr int kCellsAcross = 1000;
constexpr int kPyramidLevel = 0;  ///< the predicted plane has taken most of the motion away
constexpr double kMinEigenvalue = 1e-5;
constexpr double kMinInlierShare = 0.3;
/// Minimum share of the corners that are tracked. One in eight finds its way back on nothing but
/// the sensor's noise.
constexpr double kMinTrackedShare = 0.25;
constexpr double kMaxSigma = 0.2;
constexpr int kTrackingBorder_px = 24;  ///< room for the tracker's window around the strip

/// Input pixels -> the image's.
cv::Size in_pixels_of(const RoadImage& image, cv::Size size) {
  return {static_cast<int>(size.width / image.map.scale.x()),
          static_cast<int>(size.height / image.map.scale.x())};
}

/// Where the strip of road is in the current image, and the corners in it.
struct Strip {
  cv::Rect box;
  std::vector<cv::Point2f> corners;  ///< in the box
};

Strip find_strip(const RoadImage& cur, const RoadRegion& region, const RoadOptions& options) {
  constexpr int kStep = 4;
  const cv::Rect image({}, cur.pixels.size());
  cv::Mat mask = cv::Mat::zeros(image.size(), CV_8U);
  for (const RoadRegion::Sample& sample : region.samples(cur.full, kStep, kStep)) {
    mask(cv::Rect(sample.u, sample.v, kStep, kStep) & image).setTo(255);
  }
  const cv::Rect seen = cv::boundingRect(mask);
  if (seen.empty()) {
    return {};
  }
  const cv::Point border(kTrackingBorder_px, kTrackingBorder_px);
  Strip strip;
  strip.box = cv::Rect(seen.tl() - border, seen.br() + border - cv::Point(kStep, kStep)) & image;
  cv::goodFeaturesToTrack(cur.pixels(strip.box), strip.corners, options.max_points,
                          options.corner_quality, options.corner_distance_px / cur.map.scale.x(),
                          mask(strip.box));
  return strip;
}

/// A corner of the current image, found again in the previous one.
struct Track {
  Eigen::Vector3d ray;  ///< in the current camera, z = 1
  Eigen::Vector2d prev_uv;
  int cell = 0;  ///< corners of one cell share most of their windows
};

/// How far a track is from where the warp puts it, along its epipolar line and across.
struct Residual {
  double along_px = 0.0;
  double across_px = 0.0;
  RoadVector jacobian = RoadVector::Zero();  ///< of along_px
  bool is_valid = false;
};

Residual residual_of(const Track& track, const RoadWarp& warp, const Camera& camera) {
  Residual result;
  const double q = warp.inverse_depth(track.ray);
  const Eigen::Vector3d p = warp.rotation() * track.ray + q * warp.translation;
  if (!(q > 0.0 && p.z() > 1e-6)) {
    return result;
  }
  Eigen::Matrix<double, 2, 3> project;
  project << camera.fx_px, 0.0, -camera.fx_px * p.x() / p.z(), 0.0, camera.fy_px,
      -camera.fy_px * p.y() / p.z();
  project /= p.z();
  const Eigen::Vector2d line = (project * warp.translation).normalized();
  const Eigen::Vector2d error = camera.project(p) - track.prev_uv;
  result.along_px = line.dot(error);
  result.across_px = line.x() * error.y() - line.y() * error.x();
  const Eigen::RowVector3d g = line.transpose() * project;
  const double by_q = g.dot(warp.translation);
  result.jacobian.head<3>() = by_q * track.ray;
  result.jacobian[3] = -by_q * warp.plane.squaredNorm() / warp.plane.dot(track.ray);
  result.jacobian.tail<3>() = p.cross(g.transpose());  // of exp(w) p
  result.is_valid = std::isfinite(result.along_px);
  return result;
}

/// The homography of the predicted plane, from the strip's pixels to the previous image's.
cv::Matx33d strip_homography(const Camera& camera, const Strip& strip, const RoadWarp& warp) {
  const Eigen::Matrix3d k = camera.matrix();
  const Eigen::Matrix3d h =
      k * (warp.rotation() + warp.translation * warp.plane.transpose()) * k.inverse();
  cv::Matx33d map;
  cv::eigen2cv(h, map);
  return map * cv::Matx33d(1, 0, strip.box.x, 0, 1, strip.box.y, 0, 0, 1);
}

/// Tracks from the current image into the previous one, seen through the predicted plane.
std::vector<Track> track_corners(const RoadStep& step, const Strip& strip, const RoadWarp& warp) {
  const RoadImage& cur = step.cur;
  const cv::Matx33d map = strip_homography(cur.full.camera, strip, warp);
  cv::Mat warped;
  cv::warpPerspective(step.prev.pixels, warped, map, strip.box.size(),
                      cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  const cv::Mat image = cur.pixels(strip.box).clone();
  std::vector<cv::Point2f> there = strip.corners;
  std::vector<cv::Point2f> back = strip.corners;
  std::vector<std::uint8_t> found;
  std::vector<std::uint8_t> found_back;
  const cv::Size reach = in_pixels_of(cur, kWindowReach);
  const cv::Size window = reach + reach + cv::Size(1, 1);
  const cv::Size cell = in_pixels_of(cur, kCell);
  const auto track = [&](const cv::Mat& from, const cv::Mat& to, const auto& points, auto& ends,
                         auto& ok) {
    const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 12, 0.01);
    cv::calcOpticalFlowPyrLK(from, to, points, ends, ok, cv::noArray(), window, kPyramidLevel, stop,
                             cv::OPTFLOW_USE_INITIAL_FLOW, kMinEigenvalue);
  };
  track(image, warped, strip.corners, there, found);
  track(warped, image, there, back, found_back);
  std::vector<Track> tracks;
  for (std::size_t i = 0; i < strip.corners.size(); ++i) {
    const cv::Point2f corner = strip.corners[i];
    const cv::Point2f loop = back[i] - corner;
    const cv::Vec3d in_prev = map * cv::Vec3d(there[i].x, there[i].y, 1.0);
    if (found[i] == 0 || found_back[i] == 0 || !(in_prev[2] > 1e-6) ||
        !(std::hypot(loop.x, loop.y) <= step.options.max_loop_px / cur.map.scale.x())) {
      continue;
    }
    const Track candidate{
        cur.full.camera.normalize({corner.x + strip.box.x, corner.y + strip.box.y}).homogeneous(),
        {in_prev[0] / in_prev[2], in_prev[1] / in_prev[2]},
        static_cast<int>(corner.y) / cell.height * kCellsAcross +
            static_cast<int>(corner.x) / cell.width};
    const Residual residual = residual_of(candidate, warp, cur.full.camera);
    if (residual.is_valid &&
        std::abs(residual.across_px) <= step.options.max_off_line_px / cur.map.scale.x()) {
      tracks.push_back(candidate);
    }
  }
  return tracks;
}

struct Fit {
  RoadMatrix covariance = RoadMatrix::Zero();
  int num_inliers = 0;
};

/// Reweighted Gauss-Newton from the predicted plane: Tukey's weights, their width from the median
/// residual (it shrinks as the fit improves).
std::optional<Fit> fit_road(const std::vector<Track>& tracks,
                            const RoadStep& step,
                            RoadWarp& warp) {
  Fit fit;
  std::vector<Residual> residuals(tracks.size());
  std::vector<double> sizes(tracks.size());
  for (int iteration = 0; iteration < kFitIterations; ++iteration) {
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      residuals[i] = residual_of(tracks[i], warp, step.cur.full.camera);
      sizes[i] = residuals[i].is_valid ? std::abs(residuals[i].along_px) : 1e6;
    }
    // A normal distribution's sigma is 1.4826 times its median absolute deviation.
    const double noise_px = std::max(kMinNoise_px / step.cur.map.scale.x(), 1.4826 * median(sizes));
    RoadNormal normal;
    std::map<int, Eigen::Vector3d> cells;
    fit.num_inliers = 0;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      const double share = sizes[i] / (kTukey * noise_px);
      if (!(share < 1.0)) {
        continue;
      }
      ++fit.num_inliers;
      const double root = (1.0 - share * share) / noise_px;
      const RoadVector& j = residuals[i].jacobian;
      normal.information += root * root * j * j.transpose();
      const RoadVector gradient = root * root * residuals[i].along_px * j;
      normal.gradient += gradient;
      cells.try_emplace(tracks[i].cell, Eigen::Vector3d::Zero()).first->second +=
          gradient.head<3>();
    }
    Eigen::Vector3d spread = Eigen::Vector3d::Zero();
    for (const auto& [cell, gradient] : cells) {
      spread += gradient.cwiseAbs2();
    }
    normal.inflate_variance(spread);
    normal.add_prior(warp, step.prior, step.options.rotation_sigma_rad);
    if (!normal.step(warp)) {
      return std::nullopt;
    }
    fit.covariance = normal.covariance;
  }
  return fit;
}

}  // namespace

RoadMeasurement measure_points(const RoadStep& step) {
  if (step.cur.full.values.empty() || step.prev.pixels.size() != step.cur.pixels.size()) {
    return no_road("the image ends above the road", false);
  }
  const RoadRegion region(step.cur_from_prev, step.prior, step.options);
  const Strip strip = find_strip(step.cur, region, step.options);
  if (static_cast<int>(strip.corners.size()) < kMinPoints) {
    return no_road("no corners on the road");
  }
  RoadWarp warp(step.cur_from_prev, step.prior, step.options.camera_height_m);
  const std::vector<Track> tracks = track_corners(step, strip, warp);
  if (static_cast<int>(tracks.size()) < kMinPoints ||
      static_cast<double>(tracks.size()) <
          kMinTrackedShare * static_cast<double>(strip.corners.size())) {
    return no_road("no tracks on the road");
  }
  const std::optional<Fit> fit = fit_road(tracks, step, warp);
  if (!fit.has_value()) {
    return no_road("no plane through the points");
  }
  RoadMeasurement result = read_road(warp, fit->covariance, step.options.camera_height_m);
  const double inlier_share =
      static_cast<double>(fit->num_inliers) / static_cast<double>(tracks.size());
  result.is_valid =
      fit->num_inliers >= kMinPoints && inlier_share >= kMinInlierShare && result.sigma < kMaxSigma;
  result.reason = result.is_valid ? "" : "the points are on no common plane";
  return result;
}

}  // namespace stemvo
