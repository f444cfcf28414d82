// SPDX-License-Identifier: MIT
#include "odometry/image_turn.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <opencv2/imgproc.hpp>

#include "stemvo/rigid3.hpp"

namespace stemvo {
namespace {

/// The finest level is at least so wide, the coarsest has so many pixels at most.
constexpr int kMinWidth_px = 40;
constexpr Eigen::Index kMaxCoarsest = 600;
/// Two images share at least so much of the area, and correlate there at least so well: by the
/// right turn they do so by 0.96 and more, and a bright sky above a dark road by 0.84, whatever the
/// turn.
constexpr double kMinShared = 0.3;
constexpr double kMinLikeness = 0.9;
/// A guess that correlates less is compared with shifts of the whole image, and one of those counts
/// where it is better by so much.
constexpr double kLikely = 0.9;
constexpr double kMuchBetter = 0.05;
/// A turn that is told worse (1 sigma, pixels of the finest level): a strip, an edge.
constexpr double kMaxTurnSigma_px = 0.05;
constexpr int kIterations = 8;
constexpr double kConverged_px = 0.02;
constexpr double kMinAhead = 0.2;  ///< beyond 78 degrees of turn: out of view

using Level = ImageTurn::Level;

/// Normalized, of two arrays of gray values; -1 where one is plain.
double correlation(const auto& a, const auto& b) {
  const auto size = static_cast<decltype(a.sum())>(a.size());
  const auto sum_a = a.sum();
  const auto sum_b = b.sum();
  const auto variances =
      (a.square().sum() - sum_a * sum_a / size) * (b.square().sum() - sum_b * sum_b / size);
  return variances > 0 ? ((a * b).sum() - sum_a * sum_b / size) / std::sqrt(variances) : -1.0;
}

/// Value and derivatives along x and y.
using Sample = std::array<double, 3>;

/// Bilinear; NaN beside the mask.
Sample sample(const Eigen::ArrayXXf& pixels, const Eigen::Array2d& uv) {
  const auto x = static_cast<Eigen::Index>(uv.x());
  const auto y = static_cast<Eigen::Index>(uv.y());
  const auto dx = static_cast<float>(uv.x() - static_cast<double>(x));
  const auto dy = static_cast<float>(uv.y() - static_cast<double>(y));
  const auto at = [&](Eigen::Index row, Eigen::Index col) {
    return pixels(y + row, x + col) * (1.0F - dx) + pixels(y + row, x + col + 1) * dx;
  };
  const float value = at(0, 0) * (1.0F - dy) + at(1, 0) * dy;
  const float before = at(-1, 0) * (1.0F - dy) + at(0, 0) * dy;
  const float after = at(1, 0) * (1.0F - dy) + at(2, 0) * dy;
  const float left = at(0, -1) * (1.0F - dy) + at(1, -1) * dy;
  const float right = at(0, 1) * (1.0F - dy) + at(1, 1) * dy;
  return {value, 0.5F * (right - left), 0.5F * (after - before)};
}

/// Calls visit(value in prev, direction in cur, sample of cur) for each pixel of `prev` that `cur`
/// shows with a margin of a pixel.
template <typename Visit>
void for_each_common(const Level& prev,
                     const Level& cur,
                     const Eigen::Matrix3d& cur_from_prev,
                     const Visit& visit) {
  const auto width = static_cast<double>(cur.pixels.cols());
  const auto height = static_cast<double>(cur.pixels.rows());
  for (Eigen::Index x = 0; x < prev.pixels.cols(); ++x) {
    for (Eigen::Index y = 0; y < prev.pixels.rows(); ++y) {
      const float value = prev.pixels(y, x);
      const Eigen::Array2d at(static_cast<double>(x), static_cast<double>(y));
      const Eigen::Vector2d plane = ((at - prev.center_px) / prev.focal_px).matrix();
      const Eigen::Vector3d ray = cur_from_prev * plane.homogeneous();
      const Eigen::Vector2d there = ray.head<2>() / ray.z();
      const Eigen::Array2d uv = there.array() * cur.focal_px + cur.center_px;
      if (ray.z() > kMinAhead && (uv >= 1.0).all() && uv.x() < width - 2.0 &&
          uv.y() < height - 2.0 && !std::isnan(value)) {
        const Sample now = sample(cur.pixels, uv);
        if (!std::isnan(now[0] + now[1] + now[2])) {
          visit(value, there, now);
        }
      }
    }
  }
}

double num_seen(const Level& level) {
  return static_cast<double>(level.pixels.size() - level.pixels.isNaN().count());
}

float mean_of(const Level& level) {
  return level.pixels.isNaN().select(0.0F, level.pixels).sum() /
         static_cast<float>(num_seen(level));
}

/// Less their mean; 0 behind the mask.
Eigen::ArrayXXf centered(const Level& level) {
  return level.pixels.isNaN().select(0.0F, level.pixels - mean_of(level));
}

double likeness(const Level& prev, const Level& cur, const Eigen::Quaterniond& cur_from_prev) {
  std::vector<double> values;
  std::vector<double> now;
  for_each_common(prev, cur, cur_from_prev.toRotationMatrix(),
                  [&](float value, const Eigen::Vector2d&, const Sample& sampled) {
                    values.push_back(value);
                    now.push_back(sampled[0]);
                  });
  const auto size = std::ssize(values);
  using Values = Eigen::Map<const Eigen::ArrayXd>;
  return static_cast<double>(size) < kMinShared * num_seen(prev)
             ? -1.0
             : correlation(Values(values.data(), size), Values(now.data(), size));
}

/// Gauss-Newton from `turn`, cur_from_prev; gain and bias of the gray values are solved for, and
/// what differs by more than the others (Cauchy) counts less. Returns the error of the direction
/// that is told worst, 1 sigma, pixels.
double align_level(const Level& prev, const Level& cur, Eigen::Quaterniond& turn) {
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  using Matrix5d = Eigen::Matrix<double, 5, 5>;
  double gain = 1.0;
  double bias = static_cast<double>(mean_of(cur) - mean_of(prev));
  double scale = std::numeric_limits<double>::infinity();
  double sigma_px = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kIterations; ++i) {
    Matrix5d normal = Matrix5d::Zero();
    Vector5d right = Vector5d::Zero();
    double sum = 0.0;
    int num = 0;
    for_each_common(prev, cur, turn.toRotationMatrix(),
                    [&](float value, const Eigen::Vector2d& at, const Sample& sampled) {
                      const auto [now, gx, gy] = sampled;
                      const double off = now - gain * value - bias;
                      const double fx = gx * cur.focal_px.x();
                      const double fy = gy * cur.focal_px.y();
                      const double along = fx * at.x() + fy * at.y();
                      Vector5d row;
                      row << -fy - along * at.y(), fx + along * at.x(), fy * at.x() - fx * at.y(),
                          -static_cast<double>(value), -1.0;
                      // Of two equal images the scale is 0 too.
                      const double weight =
                          off == 0.0 ? 1.0 : 1.0 / (1.0 + off * off / (scale * scale));
                      normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
                      right -= weight * off * row;
                      sum += std::abs(off);
                      ++num;
                    });
    const Eigen::LDLT<Matrix5d, Eigen::Lower> solver(normal);
    const Vector5d step = solver.solve(right);
    if (num < 5 || !step.allFinite()) {
      return std::numeric_limits<double>::infinity();
    }
    turn = so3_exp(step.head<3>()) * turn;
    gain += step[3];
    bias += step[4];
    scale = 2.0 * sum / num;
    const Eigen::Matrix3d variances =
        solver.solve(Matrix5d::Identity()).topLeftCorner<3, 3>() * std::pow(sum / num, 2);
    sigma_px = cur.focal_px.mean() * std::sqrt(variances.trace());
    if (i > 0 && step.head<3>().norm() * cur.focal_px.mean() < kConverged_px) {
      break;
    }
  }
  return sigma_px;
}

/// The turn that shifts the middle of the image by whole pixels, so that the two correlate best.
Eigen::Quaterniond best_shift(const Level& prev, const Level& cur) {
  const int width = static_cast<int>(prev.pixels.cols());
  const int height = static_cast<int>(prev.pixels.rows());
  const Eigen::ArrayXXf before = centered(prev);
  const Eigen::ArrayXXf now = centered(cur);
  double best = -1.0;
  Eigen::Array2d shift = Eigen::Array2d::Zero();
  for (int dx = -width / 2; dx <= width / 2; ++dx) {
    for (int dy = -height / 2; dy <= height / 2; ++dy) {
      const int cols = width - std::abs(dx);
      const int rows = height - std::abs(dy);
      const auto a = before.block(std::max(0, -dy), std::max(0, -dx), rows, cols);
      const auto b = now.block(std::max(0, dy), std::max(0, dx), rows, cols);
      if (rows * cols < kMinShared * width * height) {
        continue;
      }
      if (const double value = correlation(a, b); value > best) {
        best = value;
        shift = {dx, dy};
      }
    }
  }
  const Eigen::Vector2d to = (shift / cur.focal_px).matrix();
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), to.homogeneous());
}

}  // namespace

std::vector<Level> ImageTurn::small_levels(const ImagePyramid& image) const {
  const auto halved = [](const cv::Mat& pixels) {
    cv::Mat half;
    cv::pyrDown(pixels, half);
    return half;
  };
  cv::Mat pixels = image.levels.front();
  for (const cv::Mat& level : image.levels) {
    if (level.cols >= kMinWidth_px) {
      pixels = level;
    }
  }
  while (pixels.cols >= 2 * kMinWidth_px) {
    pixels = halved(pixels);
  }
  double scale = std::exp2(std::round(std::log2(static_cast<double>(image.channel.pixels.cols) /
                                                static_cast<double>(pixels.cols))));
  std::vector<Level> levels;
  while (true) {
    const PixelMap map{scale * image.channel.map.scale, image.channel.map.offset_px};
    const cv::Mat mask = image.mask_of(map, pixels.size());
    cv::Mat values;
    pixels.convertTo(values, CV_32F);
    if (!mask.empty()) {
      values.setTo(std::numeric_limits<float>::quiet_NaN(), mask == 0);
    }
    Level level;
    using Rows = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    level.pixels = Eigen::Map<const Rows>(values.ptr<float>(), values.rows, values.cols);
    level.focal_px = Eigen::Array2d(camera_.fx_px, camera_.fy_px) / map.scale.array();
    level.center_px =
        (Eigen::Array2d(camera_.cx_px, camera_.cy_px) - map.offset_px.array()) / map.scale.array();
    levels.push_back(std::move(level));
    if (levels.back().pixels.size() <= kMaxCoarsest) {
      return levels;
    }
    pixels = halved(pixels);
    scale *= 2.0;
  }
}

std::optional<Eigen::Quaterniond> ImageTurn::align(const ImagePyramid& image,
                                                   double interval_s,
                                                   const std::optional<Eigen::Quaterniond>& hint) {
  const std::vector<Level> prev = std::exchange(last_, small_levels(image));
  expected_ = so3_exp(interval_s * rad_per_s_);
  rad_per_s_.setZero();
  refutes_guess_ = false;
  if (prev.size() != last_.size() || prev.back().pixels.size() != last_.back().pixels.size()) {
    return std::nullopt;
  }
  Eigen::Quaterniond turn = expected_.conjugate();
  double best = likeness(prev.back(), last_.back(), turn);
  const auto compare = [&](const Eigen::Quaterniond& start, double margin) {
    const double value = likeness(prev.back(), last_.back(), start);
    if (value > best + margin) {
      best = value;
      turn = start;
    }
  };
  if (hint) {
    compare(hint->conjugate(), 0.0);
  }
  if (best < kLikely) {
    compare(best_shift(prev.back(), last_.back()), kMuchBetter);
  }
  double sigma_px = 0.0;
  for (std::size_t i = prev.size(); i-- > 0;) {
    sigma_px = align_level(prev[i], last_[i], turn);
  }
  const double found = likeness(prev.front(), last_.front(), turn);
  if (!(sigma_px < kMaxTurnSigma_px) || !(found >= kMinLikeness)) {
    return std::nullopt;
  }
  const Eigen::Quaterniond guess = hint.value_or(expected_);
  refutes_guess_ = likeness(prev.front(), last_.front(), guess.conjugate()) < found - kMuchBetter;
  rad_per_s_ = so3_log(turn.conjugate()) / interval_s;
  return turn.conjugate();
}

}  // namespace stemvo
