// SPDX-License-Identifier: MIT
#include "dataset/png_filters.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <vector>

#include "stemvo/check.hpp"

namespace stemvo::dataset {
namespace {

/// One row: the filtered bytes, the row above, and where the row goes.
struct Row {
  const std::uint8_t* filtered;
  const std::uint8_t* above;
  std::uint8_t* out;
  std::size_t size;
};

/// Of left, above and above left the nearest to left + above - above left.
int paeth(int left, int above, int above_left) {
  const int to_left = std::abs(above - above_left);
  const int to_above = std::abs(left - above_left);
  const int to_above_left = std::abs(left + above - 2 * above_left);
  const int best = to_left <= to_above ? left : above;
  return to_above_left < std::min(to_left, to_above) ? above_left : best;
}

/// Each byte plus what `predict` says by its neighbours; a pixel has kChannels bytes.
template <int kChannels, typename Predict>
void add_prediction(const Row& row, const Predict& predict) {
  std::array<int, kChannels> left{};
  std::array<int, kChannels> above_left{};
  for (std::size_t i = 0; i < row.size; i += kChannels) {
    for (std::size_t c = 0; c < kChannels; ++c) {
      const int above = row.above[i + c];
      const int value = row.filtered[i + c] + predict(left[c], above, above_left[c]);
      row.out[i + c] = static_cast<std::uint8_t>(value);
      left[c] = row.out[i + c];
      above_left[c] = above;
    }
  }
}

template <int kChannels>
bool undo_filter(int filter, const Row& row) {
  switch (filter) {
    case 0:
      std::copy_n(row.filtered, row.size, row.out);
      return true;
    case 1:
      add_prediction<kChannels>(row, [](int left, int, int) { return left; });
      return true;
    case 2:
      for (std::size_t i = 0; i < row.size; ++i) {
        row.out[i] = static_cast<std::uint8_t>(row.filtered[i] + row.above[i]);
      }
      return true;
    case 3:
      add_prediction<kChannels>(row, [](int left, int above, int) { return (left + above) / 2; });
      return true;
    case 4:
      add_prediction<kChannels>(row, paeth);
      return true;
    default:
      return false;
  }
}

}  // namespace

bool undo_png_filters(std::span<const std::uint8_t> filtered, cv::Mat& image) {
  const std::size_t row_size = image.elemSize() * static_cast<std::size_t>(image.cols);
  STEMVO_CHECK(image.type() == CV_8UC1 || image.type() == CV_8UC3, "8-bit gray or RGB");
  STEMVO_CHECK(filtered.size() == (row_size + 1) * static_cast<std::size_t>(image.rows),
               "a filter and a row of bytes per row of the image");
  const std::vector<std::uint8_t> zeros(row_size, 0);
  const std::uint8_t* above = zeros.data();
  for (int v = 0; v < image.rows; ++v) {
    const std::uint8_t* in = filtered.data() + static_cast<std::size_t>(v) * (row_size + 1);
    const Row row{in + 1, above, image.ptr(v), row_size};
    const bool is_done =
        image.channels() == 1 ? undo_filter<1>(*in, row) : undo_filter<3>(*in, row);
    if (!is_done) {
      return false;
    }
    above = row.out;
  }
  return true;
}

}  // namespace stemvo::dataset
