// SPDX-License-Identifier: MIT
#include "arrays.hpp"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <memory>
#include <string_view>

#include <fmt/format.h>

namespace stemvo::python {
namespace {

template <typename T>
nb::ndarray<nb::numpy, T> owned(std::unique_ptr<T[]> data,
                                std::initializer_list<std::size_t> shape) {
  T* const values = data.get();
  nb::capsule owner(values, [](void* p) noexcept { delete[] static_cast<T*>(p); });
  data.release();
  return {values, shape, owner};
}

/// "188x640 bool".
std::string describe(const GivenArray& given) {
  const AnyArray& array = given.array;
  if (!array.is_valid()) {
    return given.type;
  }
  std::string text;
  for (std::size_t i = 0; i < array.ndim(); ++i) {
    text += fmt::format("{}{}", i == 0 ? "" : "x", array.shape(i));
  }
  // By DLPack's code; rarer ones are of numbers that numpy has not.
  constexpr const char* kKinds[] = {"int", "uint", "float", "opaque", "bfloat", "complex"};
  const nb::dlpack::dtype type = array.dtype();
  text += text.empty() ? "one " : " ";
  return text + (type == nb::dtype<bool>()       ? "bool"
                 : type.code < std::size(kKinds) ? fmt::format("{}{}", kKinds[type.code], type.bits)
                                                 : fmt::format("other type of {} bits", type.bits));
}

void write_pose(const Rigid3& pose, double* to) {
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(to);
  matrix.setIdentity();
  matrix.topRows<3>() = pose.matrix();
}

/// In the message instead of `option`, as a word of its own.
void replace_word(std::string& message, std::string_view option, std::string_view argument) {
  const auto is_part = [&](std::size_t at) {
    const char next = at < message.size() ? message[at] : ' ';
    return next == '-' || std::isalnum(static_cast<unsigned char>(next)) != 0;
  };
  for (std::size_t at = 0; (at = message.find(option, at)) != std::string::npos;) {
    if ((at == 0 || message[at - 1] == ' ' || message[at - 1] == '(') &&
        !is_part(at + option.size())) {
      message.replace(at, option.size(), argument);
      at += argument.size();
    } else {
      at += option.size();
    }
  }
}

/// Of an array HxW or HxWx3 of bytes.
Expected<ImageView> pixels_of(const GivenArray& given, const char* name) {
  const AnyArray& array = given.array;
  const bool is_color = array.ndim() == 3;
  if (std::max(array.shape(0), array.shape(1)) > std::size_t{kMaxImageSide_px}) {
    return fail(fmt::format("{}: expected at most {} pixels a side, found {}", name,
                            kMaxImageSide_px, describe(given)));
  }
  const auto height = static_cast<int>(array.shape(0));
  const auto width = static_cast<int>(array.shape(1));
  const std::int64_t channels = is_color ? 3 : 1;
  const bool is_empty = height == 0 || width == 0;
  if (!is_empty &&
      ((width > 1 && array.stride(1) != channels) || (is_color && array.stride(2) != 1) ||
       (height > 1 && array.stride(0) < width * channels))) {
    return fail(
        fmt::format("{}: expected pixels side by side in memory, found a view that flips, "
                    "skips or swaps them (numpy.ascontiguousarray makes a copy)",
                    name));
  }
  const int type = is_color ? CV_8UC3 : CV_8UC1;
  if (is_empty) {
    return ImageView{cv::Mat(height, width, type), is_color ? PixelOrder::kRgb : PixelOrder::kGray};
  }
  // cv::Mat has no constant pixels; the odometry only reads.
  auto* const pixels = const_cast<std::uint8_t*>(static_cast<const std::uint8_t*>(array.data()));
  const std::size_t step =
      height > 1 ? static_cast<std::size_t>(array.stride(0)) : cv::Mat::AUTO_STEP;
  return ImageView{cv::Mat(height, width, type, pixels, step),
                   is_color ? PixelOrder::kRgb : PixelOrder::kGray};
}

}  // namespace

std::string in_python(std::string message) {
  constexpr std::string_view kKey = "--set ";
  if (message.starts_with(kKey)) {
    message.erase(0, kKey.size());
  }
  for (const auto& [words, ours] :
       {std::pair("a folder, a video file, a quoted pattern of images or camera:N",
                  "a folder or a pattern of images (docs/python.md: FrameView for videos)"),
        std::pair(" ('stemvo run --help' lists what is read)", "")}) {
    if (const std::size_t at = message.find(words); at != std::string::npos) {
      message.replace(at, std::string_view(words).size(), ours);
    }
  }
  for (const auto& [option, argument] :
       {std::pair("--camera FILE", "camera_file"), std::pair("--camera", "camera_file"),
        std::pair("--times FILE", "times"), std::pair("--times", "times"),
        std::pair("--rate HZ", "rate"), std::pair("--rate", "rate"),
        std::pair("--calib FILE", "calibration"), std::pair("--calib", "calibration"),
        std::pair("--gt-tolerance", "tolerance_s"), std::pair("--gt", "ground_truth"),
        std::pair("--mask", "masks"), std::pair("--frames", "frames")}) {
    replace_word(message, option, argument);
  }
  return message;
}

Expected<ImageView> view_of(const GivenArray& given, const char* name) {
  const AnyArray& array = given.array;
  if (!array.is_valid() || array.dtype() != nb::dtype<std::uint8_t>() ||
      !(array.ndim() == 2 || (array.ndim() == 3 && array.shape(2) == 3))) {
    return fail(fmt::format("{}: expected an array HxW (gray) or HxWx3 (RGB) uint8, found {}", name,
                            describe(given)));
  }
  return pixels_of(given, name);
}

Expected<cv::Mat> mask_of(const GivenArray& given) {
  const AnyArray& array = given.array;
  if (!array.is_valid() || array.ndim() != 2 ||
      !(array.dtype() == nb::dtype<std::uint8_t>() || array.dtype() == nb::dtype<bool>())) {
    return fail(
        fmt::format("mask: expected an array HxW uint8 or bool, found {}", describe(given)));
  }
  return pixels_of(given, "mask").map([](const ImageView& view) { return view.pixels; });
}

ByteArray array_of(const cv::Mat& image) {
  const auto rows = static_cast<std::size_t>(image.rows);
  const auto columns = static_cast<std::size_t>(image.cols);
  auto data = std::make_unique<std::uint8_t[]>(image.total() * image.elemSize());
  cv::Mat copy(image.rows, image.cols, image.type(), data.get());
  image.copyTo(copy);
  return image.channels() == 1 ? owned(std::move(data), {rows, columns})
                               : owned(std::move(data), {rows, columns, 3});
}

bool is_rotation(const Eigen::Matrix3d& matrix) {
  return (matrix.transpose() * matrix).isIdentity(1e-3) && matrix.determinant() > 0.0;
}

Expected<Trajectory> trajectory_of(const GivenArray& given, const std::string& name) {
  const AnyArray& array = given.array;
  const bool is_poses = array.is_valid() && array.ndim() == 3 &&
                        (array.shape(1) == 3 || array.shape(1) == 4) && array.shape(2) == 4;
  if (!is_poses || array.dtype() != nb::dtype<double>() || array.shape(0) == 0) {
    return fail(
        fmt::format("{}: expected an array Nx4x4 float64, found {}", name, describe(given)));
  }
  Trajectory poses;
  const auto* const data = static_cast<const double*>(array.data());
  for (std::size_t i = 0; i < array.shape(0); ++i) {
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    for (int row = 0; row < static_cast<int>(array.shape(1)); ++row) {
      for (int column = 0; column < 4; ++column) {
        matrix(row, column) = data[static_cast<std::int64_t>(i) * array.stride(0) +
                                   row * array.stride(1) + column * array.stride(2)];
      }
    }
    if (!matrix.allFinite() || !is_rotation(matrix.topLeftCorner<3, 3>()) ||
        matrix.row(3) != Eigen::RowVector4d::UnitW()) {
      return fail(fmt::format(
          "{}[{}]: expected a rotation, a finite translation beside it and 0, 0, 0, 1 below, found "
          "other numbers",
          name, i));
    }
    poses.push_back(Rigid3::from_matrix(matrix.topRows<3>()));
  }
  return poses;
}

DoubleArray array_of(const Rigid3& pose) {
  auto data = std::make_unique<double[]>(16);
  write_pose(pose, data.get());
  return owned(std::move(data), {4, 4});
}

DoubleArray array_of(std::span<const Rigid3> trajectory) {
  auto data = std::make_unique<double[]>(16 * trajectory.size());
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    write_pose(trajectory[i], data.get() + 16 * i);
  }
  return owned(std::move(data), {trajectory.size(), 4, 4});
}

DoubleArray array_of(std::span<const double> numbers) {
  auto data = std::make_unique<double[]>(numbers.size());
  std::copy(numbers.begin(), numbers.end(), data.get());
  return owned(std::move(data), {numbers.size()});
}

IndexArray array_of(std::span<const std::size_t> indices) {
  auto data = std::make_unique<std::int64_t[]>(indices.size());
  std::copy(indices.begin(), indices.end(), data.get());
  return owned(std::move(data), {indices.size()});
}

IndexArray array_of(std::span<const int> ids) {
  auto data = std::make_unique<std::int64_t[]>(ids.size());
  std::copy(ids.begin(), ids.end(), data.get());
  return owned(std::move(data), {ids.size()});
}

std::pair<DoubleArray, ByteArray> arrays_of(std::span<const MapLandmark> landmarks) {
  const std::size_t n = landmarks.size();
  auto positions = std::make_unique<double[]>(3 * n);
  auto colors = std::make_unique<std::uint8_t[]>(3 * n);
  for (std::size_t i = 0; i < n; ++i) {
    const MapLandmark& landmark = landmarks[i];
    Eigen::Map<Eigen::Vector3d>(positions.get() + 3 * i) = landmark.position;
    std::ranges::copy(landmark.rgb, colors.get() + 3 * i);
  }
  return {owned(std::move(positions), {n, 3}), owned(std::move(colors), {n, 3})};
}

std::pair<DoubleArray, BoolArray> arrays_of(std::span<const TrackedPoint> points) {
  const std::size_t n = points.size();
  auto places = std::make_unique<double[]>(4 * n);
  auto are_inliers = std::make_unique<bool[]>(n);
  for (std::size_t i = 0; i < n; ++i) {
    Eigen::Map<Eigen::Vector4d>(places.get() + 4 * i) << points[i].prev_uv, points[i].uv;
    are_inliers[i] = points[i].is_inlier;
  }
  return {owned(std::move(places), {n, 4}), owned(std::move(are_inliers), {n})};
}

}  // namespace stemvo::python
