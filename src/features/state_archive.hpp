// SPDX-License-Identifier: MIT
#pragma once

// How the state of a front end becomes bytes and is made of them again, by cereal. Only source
// files include this; a class with a state has a template `serialize` of its own.

#include <algorithm>
#include <functional>
#include <type_traits>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cereal/types/map.hpp>
#include <cereal/types/vector.hpp>
#include <opencv2/core.hpp>

#include "features/front_end.hpp"
#include "features/patch_alignment.hpp"
#include "features/state_reader.hpp"

namespace Eigen {

template <typename Archive, typename Scalar, int kRows, int kCols>
  requires(kRows > 0 && kCols > 0)
void serialize(Archive& archive, Matrix<Scalar, kRows, kCols>& matrix) {
  archive(cereal::binary_data(matrix.data(), sizeof(Scalar) * kRows * kCols));
}

template <typename Archive>
void serialize(Archive& archive, Quaterniond& rotation) {
  archive(rotation.coeffs());
}

}  // namespace Eigen

namespace cv {

template <typename Archive>
void save(Archive& archive, const Mat& mat) {
  archive(mat.rows, mat.cols, mat.type());
  for (int row = 0; row < mat.rows; ++row) {
    archive(cereal::binary_data(mat.ptr(row), mat.elemSize() * static_cast<std::size_t>(mat.cols)));
  }
}

inline void load(stemvo::StateReader& archive, Mat& mat) {
  int rows = 0;
  int cols = 0;
  int type = 0;
  archive(rows, cols, type);
  stemvo::StateReader::expect(rows >= 0 && cols >= 0 && (rows == 0) == (cols == 0) &&
                              type == CV_MAT_TYPE(type) && CV_MAT_DEPTH(type) <= CV_64F);
  const std::size_t num_values = static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols);
  stemvo::StateReader::expect(num_values <= archive.num_left() / CV_ELEM_SIZE(type));
  mat = Mat(rows, cols, type);
  for (int row = 0; row < rows; ++row) {
    archive(cereal::binary_data(mat.ptr(row), mat.elemSize() * static_cast<std::size_t>(cols)));
  }
}

template <typename Archive>
void serialize(Archive& archive, Point2f& point) {
  archive(point.x, point.y);
}

}  // namespace cv

namespace stemvo {

/// Numbers only, no pointers.
template <typename Archive, typename T>
  requires(std::is_trivially_copyable_v<T>)
void serialize_bytes(Archive& archive, T& value) {
  archive(cereal::binary_data(&value, sizeof(T)));
}

template <typename Archive>
void serialize(Archive& archive, PixelMap& map) {
  archive(map.scale, map.offset_px);
  StateReader::expect_of<Archive>(map.scale.minCoeff() > 1e-2 && map.scale.maxCoeff() < 1e4 &&
                                  map.offset_px.cwiseAbs().maxCoeff() < 1e6);
}
template <typename Archive>
void serialize(Archive& archive, ChannelImage& image) {
  archive(image.pixels, image.map);
  StateReader::expect_of<Archive>(image.pixels.empty() || image.pixels.type() == CV_8UC1);
}
template <typename Archive>
void serialize(Archive& archive, Patch& patch) {
  serialize_bytes(archive, patch);
}
template <typename Archive>
void serialize(Archive& archive, Similarity& warp) {
  serialize_bytes(archive, warp);
}
template <typename Archive>
void serialize(Archive& archive, TrackPoint& point) {
  archive(point.track_id, point.uv);
}
template <typename Archive>
void serialize(Archive& archive, Matches& matches) {
  archive(matches.prev_uv, matches.cur_uv, matches.track_ids, matches.prev_frame,
          matches.num_keypoints);
  StateReader::expect_of<Archive>(matches.prev_uv.size() == matches.cur_uv.size() &&
                                  matches.track_ids.size() == matches.cur_uv.size());
}
/// They are looked up by their ids, and each is there once.
template <typename Archive, typename Points, typename Id>
void expect_ordered(const Points& points, Id id) {
  StateReader::expect_of<Archive>(
      std::ranges::adjacent_find(points, std::ranges::greater_equal(), id) == points.end());
}

}  // namespace stemvo
