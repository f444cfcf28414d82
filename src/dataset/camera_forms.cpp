// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "dataset/camera_file.hpp"
#include "odometry/check_frame.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace {

/// A row is number, name, width, height, focal lengths, centre, coefficients.
struct ColmapModel {
  std::string_view name;
  std::size_t num_focal = 1;
  std::size_t num_coefficients = 0;
  Distortion distortion = Distortion::kRadialTangential;
};
constexpr std::array<ColmapModel, 9> kColmapModels = {{
    {"SIMPLE_PINHOLE"},
    {"PINHOLE", 2},
    {"SIMPLE_RADIAL", 1, 1},
    {"RADIAL", 1, 2},
    {"OPENCV", 2, 4},
    {"FULL_OPENCV", 2, 8},
    {"SIMPLE_RADIAL_FISHEYE", 1, 1, Distortion::kEquidistant},
    {"RADIAL_FISHEYE", 1, 2, Distortion::kEquidistant},
    {"OPENCV_FISHEYE", 2, 4, Distortion::kEquidistant},
}};

Expected<Camera> parse_colmap_row(const std::string& row) {
  const std::vector<std::string_view> words = split_words(row);
  const auto model =
      std::ranges::find(kColmapModels, words.size() > 1 ? words[1] : "", &ColmapModel::name);
  if (model == kColmapModels.end()) {
    return fail(
        fmt::format("expected COLMAP's CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS with a model from "
                    "SIMPLE_PINHOLE "
                    "to OPENCV_FISHEYE, found '{}'",
                    one_line(row)));
  }
  std::string_view rest = row;
  (void)take_word(rest);
  (void)take_word(rest);
  const std::size_t num_focal = model->num_focal;
  STEMVO_TRY_GET(const auto n, parse_numbers(rest, 4 + num_focal + model->num_coefficients));
  for (const double side : {n[0], n[1]}) {
    if (!(side >= 1.0 && side <= kMaxImageSide_px)) {
      return fail(
          fmt::format("expected sides of 1 to {} pixels, found {}", kMaxImageSide_px, side));
    }
  }
  // Its pixels' centres have halves.
  Camera camera{n[2],
                n[1 + num_focal],
                n[2 + num_focal] - 0.5,
                n[3 + num_focal] - 0.5,
                static_cast<int>(n[0]),
                static_cast<int>(n[1])};
  if (model->num_coefficients > 0) {
    camera.distortion = model->distortion;
    std::copy(n.begin() + 4 + static_cast<std::ptrdiff_t>(num_focal), n.end(),
              camera.distortion_coefficients.begin());
  }
  return camera;
}

}  // namespace

Expected<CameraFile> read_colmap_camera(const std::filesystem::path& file) {
  STEMVO_TRY_GET(const auto lines, read_lines(file, kMaxSettings_MB));
  CameraFile result;
  std::size_t num_cameras = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (split_words(lines[i]).empty() || lines[i].starts_with('#')) {
      continue;
    }
    STEMVO_TRY_GET(result.camera, at_line(file, i, parse_colmap_row(lines[i])));
    STEMVO_TRY(check_camera(result.camera, fmt::format("{}:{}", file.string(), i + 1)));
    ++num_cameras;
  }
  return num_cameras == 1
             ? Expected<CameraFile>(result)
             : fail(fmt::format("{}: expected one camera, found {}", file.string(), num_cameras));
}

std::string camera_file_text(const CameraFile& file) {
  const Camera& camera = file.camera;
  constexpr const char* kModels[] = {"none", "radial-tangential", "equidistant"};
  const auto model = static_cast<std::size_t>(camera.distortion);
  constexpr std::size_t kNumCoefficients[] = {0, 5, 4};
  const std::span<const double> all = camera.distortion_coefficients;
  const bool has_more = std::ranges::any_of(all.subspan(5), [](double k) { return k != 0.0; });
  const auto coefficients = all.first(has_more ? all.size() : kNumCoefficients[model]);
  std::string text = fmt::format(
      "image_width: {}\nimage_height: {}\ncamera_model: pinhole\n"
      "intrinsics: [{:.4f}, {:.4f}, {:.4f}, {:.4f}]  # fx, fy, cx, cy\n"
      "distortion_model: {}\ndistortion_coefficients: [{:.6f}]\n",
      camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px,
      kModels[model], fmt::join(coefficients, ", "));
  if (file.body_from_camera) {
    const Matrix34d matrix = file.body_from_camera->matrix();
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = matrix;
    text += fmt::format("T_BS: [{:.9f}]\n", fmt::join(rows.data(), rows.data() + 12, ", "));
  }
  if (file.rate_hz) {
    text += fmt::format("rate_hz: {}\n", *file.rate_hz);
  }
  if (file.camera_height_m) {
    text += fmt::format("camera_height: {}\n", *file.camera_height_m);
  }
  return text;
}

}  // namespace stemvo::dataset
