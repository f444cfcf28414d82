// SPDX-License-Identifier: MIT
#pragma once

#include <opencv2/calib3d.hpp>

#include "stemvo/camera.hpp"
#include "support/test.hpp"

namespace stemvo::test {

/// A print: gray values per board point, x to the right, y down, from a corner of the pattern.
struct Print {
  cv::Mat texture;          ///< CV_8UC1
  double texels_per_m = 0;  ///< along both sides
  cv::Point2d origin_m;     ///< of the texture's upper left corner
  cv::Rect2d pattern_m;     ///< that must be seen
};

/// A chessboard of columns x rows inner corners, with a white margin; (0, 0) is the first of them.
inline Print print_chessboard(const cv::Size& corners, double square_m) {
  constexpr int kTexels = 60;
  Print print;
  print.texture = cv::Mat((corners.height + 3) * kTexels, (corners.width + 3) * kTexels, CV_8UC1,
                          cv::Scalar(225));
  for (int y = 0; y <= corners.height; ++y) {
    for (int x = y % 2; x <= corners.width; x += 2) {
      print.texture(cv::Rect((x + 1) * kTexels, (y + 1) * kTexels, kTexels, kTexels)) = 30;
    }
  }
  print.texels_per_m = kTexels / square_m;
  print.origin_m = {-2.0 * square_m, -2.0 * square_m};
  print.pattern_m = {-square_m, -square_m, (corners.width + 1) * square_m,
                     (corners.height + 1) * square_m};
  return print;
}

/// Marks of a dictionary: rows of `size` bits, white is 1, below a black border.
inline void draw_mark(cv::Mat area, std::uint64_t bits, int size, int border) {
  area = 30;
  const double cell = static_cast<double>(area.cols) / (size + 2 * border);
  for (int i = 0; i < size * size; ++i) {
    if ((bits >> (size * size - 1 - i) & 1U) != 0) {
      const cv::Point at(cvRound((i % size + border) * cell), cvRound((i / size + border) * cell));
      const cv::Point end(cvRound((i % size + border + 1) * cell),
                          cvRound((i / size + border + 1) * cell));
      area(cv::Rect(at, end)) = 225;
    }
  }
}

/// A ChArUco board of columns x rows squares of 0.03 m, marks of 0.0225 m from DICT_4X4_50 in the
/// white ones; the upper left one is black, or white as before OpenCV 4.6.
inline Print print_charuco(const cv::Size& squares, bool is_first_white) {
  constexpr std::uint64_t kMarks[] = {0xb532, 0xf9a,  0x332d, 0x9946, 0x549e, 0x79cd,
                                      0x9e2e, 0xc4f2, 0xfeda, 0xcf56, 0xf991, 0x11a7};
  constexpr int kTexels = 96;
  Print print = print_chessboard(squares - cv::Size(1, 1), 0.03);
  print.texture = cv::Mat((squares.height + 2) * kTexels, (squares.width + 2) * kTexels, CV_8UC1,
                          cv::Scalar(225));
  std::size_t next = 0;
  for (int y = 0; y < squares.height; ++y) {
    for (int x = 0; x < squares.width; ++x) {
      cv::Mat area =
          print.texture(cv::Rect((x + 1) * kTexels, (y + 1) * kTexels, kTexels, kTexels));
      if ((x + y) % 2 == (is_first_white ? 1 : 0)) {
        area = 30;
      } else {
        draw_mark(area(cv::Rect(12, 12, 72, 72)), kMarks[next++], 4, 1);
      }
    }
  }
  print.texels_per_m = kTexels / 0.03;
  return print;
}

/// A grid of 4x3 tags of DICT_APRILTAG_36h11, 0.03 m with gaps of 0.009 m: Kalibr's, from the lower
/// left on, with wide borders and squares between, or OpenCV's.
inline Print print_tags(bool is_kalibr) {
  constexpr std::uint64_t kMarks[] = {0x21a146bab, 0x92d18fe9b, 0x7089014bb, 0x193979e27,
                                      0x44153d3d7, 0x35cd5b8cf, 0xa10ba56a0, 0x2b874a608,
                                      0xb57fb8d44, 0x4e20b5a64, 0x61d897f2c, 0xab3469ffc};
  constexpr int kTag = 80;
  constexpr int kGap = 24;
  constexpr int kMargin = 60;
  const auto at = [](int cell) { return kMargin + cell * (kTag + kGap); };
  Print print;
  print.texture = cv::Mat(at(3) + kMargin, at(4) + kMargin, CV_8UC1, cv::Scalar(225));
  for (int id = 0; id < 12; ++id) {
    const int row = is_kalibr ? 2 - id / 4 : id / 4;
    draw_mark(print.texture(cv::Rect(at(id % 4), at(row), kTag, kTag)), kMarks[id], 6,
              is_kalibr ? 2 : 1);
  }
  for (int corner = 0; is_kalibr && corner < 20; ++corner) {
    print.texture(cv::Rect(at(corner % 5) - kGap, at(corner / 5) - kGap, kGap, kGap)) = 30;
  }
  print.texels_per_m = kTag / 0.03;
  const double margin_m = kMargin / print.texels_per_m;
  print.origin_m = {-margin_m, -margin_m};
  print.pattern_m = {-0.009, -0.009, 0.165, 0.126};
  return print;
}

/// Photographs prints with a camera of known intrinsics: exact rays, blur, noise.
class BoardCamera {
 public:
  explicit BoardCamera(const Camera& camera)
      : camera_(camera),
        k_(camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1),
        lens_(camera.distortion_coefficients.begin(), camera.distortion_coefficients.end()) {
    std::vector<cv::Point2d> pixels;
    for (int y = 0; y < 2 * camera.height_px; ++y) {
      for (int x = 0; x < 2 * camera.width_px; ++x) {
        pixels.emplace_back(0.5 * x - 0.25, 0.5 * y - 0.25);
      }
    }
    cv::undistortPoints(pixels, rays_, k_, lens_, cv::noArray(), cv::noArray(),
                        {cv::TermCriteria::COUNT, 20, 0.0});
  }

  /// A pose from which the camera sees all of the pattern: tilted by up to `max_tilt_rad` about
  /// either axis, at a distance at which it takes 0.3 to 0.8 of the image's width.
  void choose_pose(const Print& print, double max_tilt_rad, cv::RNG& random) {
    const cv::Rect2d& box = print.pattern_m;
    const cv::Vec3d middle(box.x + 0.5 * box.width, box.y + 0.5 * box.height, 0.0);
    do {
      r_ = {random.uniform(-max_tilt_rad, max_tilt_rad),
            random.uniform(-max_tilt_rad, max_tilt_rad), random.uniform(-0.4, 0.4)};
      const double z = box.width * camera_.fx_px / camera_.width_px / random.uniform(0.3, 0.8);
      // Braces: in this order, whatever the compiler.
      const cv::Vec3d center{z * random.uniform(-0.5, 0.5) * camera_.width_px / camera_.fx_px,
                             z * random.uniform(-0.5, 0.5) * camera_.height_px / camera_.fy_px, z};
      cv::Matx33d rotation;
      cv::Rodrigues(r_, rotation);
      t_ = center - rotation * middle;
    } while (!sees(box));
  }

  [[nodiscard]] cv::Mat photograph(const Print& print, double blur_px, cv::RNG& random) const {
    cv::Matx33d ray_from_board;
    cv::Rodrigues(r_, ray_from_board);
    for (int i = 0; i < 3; ++i) {
      ray_from_board(i, 2) = t_[i];
    }
    const cv::Matx33d board_from_ray = ray_from_board.inv();
    cv::Mat map(2 * camera_.height_px, 2 * camera_.width_px, CV_32FC2);
    auto texel = map.begin<cv::Vec2f>();
    for (const cv::Point2d& ray : rays_) {
      const cv::Vec3d at = board_from_ray * cv::Vec3d(ray.x, ray.y, 1.0);
      *texel++ = {
          static_cast<float>((at[0] / at[2] - print.origin_m.x) * print.texels_per_m - 0.5),
          static_cast<float>((at[1] / at[2] - print.origin_m.y) * print.texels_per_m - 0.5)};
    }
    cv::Mat fine;
    cv::remap(print.texture, fine, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT, 150);
    cv::Mat image;
    cv::resize(fine, image, {camera_.width_px, camera_.height_px}, 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(image, image, {}, blur_px);
    cv::Mat noise(image.size(), CV_16SC1);
    random.fill(noise, cv::RNG::NORMAL, 0.0, 3.0);
    cv::add(image, noise, image, cv::noArray(), CV_8U);
    return image;
  }

 private:
  [[nodiscard]] bool sees(const cv::Rect2d& box) const {
    const std::vector<cv::Point3d> outline = {{box.x, box.y, 0.0},
                                              {box.x + box.width, box.y, 0.0},
                                              {box.x, box.y + box.height, 0.0},
                                              {box.x + box.width, box.y + box.height, 0.0}};
    std::vector<cv::Point2d> seen;
    cv::projectPoints(outline, r_, t_, k_, lens_, seen);
    const cv::Rect2d inside(4.0, 4.0, camera_.width_px - 8.0, camera_.height_px - 8.0);
    return std::all_of(seen.begin(), seen.end(),
                       [&](const cv::Point2d& point) { return inside.contains(point); });
  }

  Camera camera_;
  cv::Matx33d k_;
  std::vector<double> lens_;
  std::vector<cv::Point2d> rays_;  ///< of a grid twice as fine, row by row
  cv::Vec3d r_;
  cv::Vec3d t_;
};

}  // namespace stemvo::test
