// SPDX-License-Identifier: MIT
#include "odometry/image_turn.hpp"

#include <algorithm>
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
constexpr int kMaxCoarsest = 600;
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
constexpr double kConverged_px = 0.1;  ///< of Gauss-Newton: the next step would be a tenth of it
/// A guess so near the turn that was found is no other one, pixels of the finest level.
constexpr double kSame_px = 0.25;
/// Errors below count the same, gray values.
constexpr double kLeastScale = 1e-3;
constexpr float kMinAhead = 0.2F;  ///< beyond 78 degrees of turn: out of view

using Level = ImageTurn::Level;

/// The sums that a correlation is made of.
struct Sums {
  double count = 0.0;
  double a = 0.0;
  double b = 0.0;
  double aa = 0.0;
  double bb = 0.0;
  double ab = 0.0;

  /// Normalized; -1 where one of the two is plain.
  [[nodiscard]] double correlation() const {
    constexpr double kPlain = 1e-4;  // gray values squared: less is rounding
    const double of_a = aa - a * a / count;
    const double of_b = bb - b * b / count;
    return std::min(of_a, of_b) > kPlain * count ? (ab - a * b / count) / std::sqrt(of_a * of_b)
                                                 : -1.0;
  }
};

/// What alignment needs of each pixel of a level: its value, and how the value changes with the
/// turn of the camera that sees it. Inverse composition (Baker and Matthews, 2004): one image's
/// derivatives serve all iterations.
struct Template {
  using Row =
      Eigen::Array<float, 8, 1>;       ///< by the turn (3), by gain, by bias; 5: the error's place
  std::vector<Eigen::Vector2f> plane;  ///< where z = 1
  std::vector<Row> rows;
  double sum = 0.0;  ///< of the values

  [[nodiscard]] float value(std::size_t i) const { return -rows[i][3]; }

  explicit Template(const Level& level) {
    for (int y = 1; y + 1 < level.pixels.rows; ++y) {
      for (int x = 1; x + 1 < level.pixels.cols; ++x) {
        const auto slope = [&](int dy, int dx) {
          return 0.5F * (level.pixels(y + dy, x + dx) - level.pixels(y - dy, x - dx));
        };
        const float fx = slope(0, 1) * level.focal_px.x();
        const float fy = slope(1, 0) * level.focal_px.y();
        const float value = level.pixels(y, x);
        if (std::isnan(value + fx + fy)) {
          continue;
        }
        const Eigen::Vector2f at = plane.emplace_back(
            (Eigen::Array2f(static_cast<float>(x), static_cast<float>(y)) - level.center_px) /
            level.focal_px);
        sum += value;
        const float along = fx * at.x() + fy * at.y();
        rows.emplace_back() << -fy - along * at.y(), fx + along * at.x(), fy * at.x() - fx * at.y(),
            -value, -1.0F, 0.0F, 0.0F, 0.0F;
      }
    }
  }
};

/// Calls visit(index in `prev`, value in `cur`) for each of its pixels that `cur` shows.
template <typename Visit>
void for_each_common(const Template& prev,
                     const Level& cur,
                     const Eigen::Quaterniond& cur_from_prev,
                     const Visit& visit) {
  const Eigen::Matrix3f turn = cur_from_prev.toRotationMatrix().cast<float>();
  const auto right = static_cast<float>(cur.pixels.cols - 1);
  const auto bottom = static_cast<float>(cur.pixels.rows - 1);
  const std::size_t stride = cur.pixels.step1();
  for (std::size_t i = 0; i < prev.plane.size(); ++i) {
    const Eigen::Vector3f ray = turn * prev.plane[i].homogeneous();
    const float inverse_z = 1.0F / ray.z();
    const float u = ray.x() * inverse_z * cur.focal_px.x() + cur.center_px.x();
    const float v = ray.y() * inverse_z * cur.focal_px.y() + cur.center_px.y();
    if (ray.z() > kMinAhead && u >= 0.0F && v >= 0.0F && u < right && v < bottom) {
      const int x = static_cast<int>(u);
      const int y = static_cast<int>(v);
      const float du = u - static_cast<float>(x);
      const float dv = v - static_cast<float>(y);
      const float* const at = cur.pixels[y] + x;
      const float above = at[0] + du * (at[1] - at[0]);
      const float below = at[stride] + du * (at[stride + 1] - at[stride]);
      if (const float now = above + dv * (below - above); !std::isnan(now)) {
        visit(i, now);
      }
    }
  }
}

double likeness(const Template& prev, const Level& cur, const Eigen::Quaterniond& cur_from_prev) {
  Sums sums;
  for_each_common(prev, cur, cur_from_prev, [&](std::size_t i, double now) {
    const double value = prev.value(i);
    ++sums.count;
    sums.a += value;
    sums.b += now;
    sums.aa += value * value;
    sums.bb += now * now;
    sums.ab += value * now;
  });
  return sums.count < kMinShared * static_cast<double>(prev.rows.size()) ? -1.0
                                                                         : sums.correlation();
}

double mean_of(const Level& level) {
  return cv::mean(level.pixels, level.pixels == level.pixels)[0];
}

/// Gauss-Newton from `turn`, cur_from_prev; gain and bias of the gray values are solved for, and
/// what differs by more than the others (Cauchy) counts less. Returns the error of the direction
/// that is told worst, 1 sigma, pixels.
double align_level(const Template& prev, const Level& cur, Eigen::Quaterniond& turn) {
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  using Matrix5d = Eigen::Matrix<double, 5, 5>;
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  double gain = 1.0;
  double bias = mean_of(cur) - prev.sum / static_cast<double>(prev.rows.size());
  double scale = kUnknown;
  double sigma_px = kUnknown;
  for (int i = 0; i < kIterations; ++i) {
    Eigen::Array<float, 8, 6> products = Eigen::Array<float, 8, 6>::Zero();
    const auto gain_now = static_cast<float>(gain);
    const auto bias_now = static_cast<float>(bias);
    const auto inverse_scale = static_cast<float>(1.0 / std::max(scale, kLeastScale));
    float sum = 0.0F;
    int num = 0;
    for_each_common(prev, cur, turn, [&](std::size_t k, float now) {
      Template::Row row = prev.rows[k];
      const float off = now - gain_now * prev.value(k) - bias_now;
      const float weight = 1.0F / (1.0F + std::pow(off * inverse_scale, 2.0F));
      row[5] = off;
      for (int column = 0; column < 6; ++column) {
        products.col(column) += weight * row[column] * row;
      }
      sum += std::abs(off);
      ++num;
    });
    const Matrix5d normal = products.topLeftCorner<5, 5>().matrix().cast<double>();
    const Eigen::LDLT<Matrix5d> solver(normal);
    const Vector5d step = -solver.solve(products.col(5).head<5>().matrix().cast<double>());
    if (num < 5 || !step.allFinite() || !(gain + step[3] > 0.0)) {
      return kUnknown;
    }
    const Eigen::Vector3d by = step.head<3>() / gain;  // `cur` is gain times as steep
    turn = turn * so3_exp(by);
    const Eigen::Matrix3d variances = solver.solve(Matrix5d::Identity()).topLeftCorner<3, 3>();
    const double mean = static_cast<double>(sum) / num;
    sigma_px = cur.focal_px.mean() * std::sqrt(variances.trace()) * mean / gain;
    gain += step[3];
    bias += step[4];
    scale = 2.0 * mean;
    if (i > 0 && by.norm() * cur.focal_px.mean() < kConverged_px) {
      break;
    }
  }
  return sigma_px;
}

/// Less their mean; 0 behind the mask.
cv::Mat1f centered(const Level& level) {
  cv::Mat1f values = level.pixels - mean_of(level);
  cv::patchNaNs(values);
  return values;
}

/// The turn that shifts the middle of the image by whole pixels, so that the two correlate best.
Eigen::Quaterniond best_shift(const Level& prev, const Level& cur) {
  const cv::Size size = prev.pixels.size();
  const cv::Mat1f before = centered(prev);
  const cv::Mat1f now = centered(cur);
  cv::Mat1d sum_before, squares_before, sum_now, squares_now;
  cv::integral(before, sum_before, squares_before, CV_64F, CV_64F);
  cv::integral(now, sum_now, squares_now, CV_64F, CV_64F);
  const auto inside = [](const cv::Mat1d& sums, const cv::Rect& part) {
    return sums(part.br()) - sums(part.y, part.br().x) - sums(part.br().y, part.x) +
           sums(part.tl());
  };
  double best = -1.0;
  Eigen::Array2f shift = Eigen::Array2f::Zero();
  for (int dx = -size.width / 2; dx <= size.width / 2; ++dx) {
    for (int dy = -size.height / 2; dy <= size.height / 2; ++dy) {
      const cv::Size common(size.width - std::abs(dx), size.height - std::abs(dy));
      if (common.area() < kMinShared * size.area()) {
        continue;
      }
      const cv::Rect a({std::max(0, -dx), std::max(0, -dy)}, common);
      const cv::Rect b({std::max(0, dx), std::max(0, dy)}, common);
      const Sums sums{
          static_cast<double>(common.area()), inside(sum_before, a),  inside(sum_now, b),
          inside(squares_before, a),          inside(squares_now, b), before(a).dot(now(b))};
      if (const double value = sums.correlation(); value > best) {
        best = value;
        shift = {static_cast<float>(dx), static_cast<float>(dy)};
      }
    }
  }
  const Eigen::Vector2f to = (shift / cur.focal_px).matrix();
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(),
                                            to.homogeneous().cast<double>());
}

}  // namespace

std::vector<Level> ImageTurn::small_levels(const ImagePyramid& image) const {
  cv::Mat pixels = image.levels.front();
  for (const cv::Mat& level : image.levels) {
    if (level.cols >= kMinWidth_px) {
      pixels = level;
    }
  }
  while (pixels.cols >= 2 * kMinWidth_px) {
    cv::pyrDown(pixels, pixels);
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
    const Eigen::Array2d focal_px =
        Eigen::Array2d(camera_.fx_px, camera_.fy_px) / map.scale.array();
    const Eigen::Array2d center_px =
        (Eigen::Array2d(camera_.cx_px, camera_.cy_px) - map.offset_px.array()) / map.scale.array();
    levels.push_back({values, focal_px.cast<float>(), center_px.cast<float>()});
    if (values.size().area() <= kMaxCoarsest) {
      return levels;
    }
    cv::pyrDown(pixels, pixels);
    scale *= 2.0;
  }
}

std::optional<Eigen::Quaterniond> ImageTurn::align(const ImagePyramid& image,
                                                   double interval_s,
                                                   const std::optional<Eigen::Quaterniond>& hint) {
  const std::vector<Level> before = std::exchange(last_, small_levels(image));
  expected_ = so3_exp(interval_s * rad_per_s_);
  rad_per_s_.setZero();
  refutes_guess_ = false;
  if (before.size() != last_.size() || before.back().pixels.size() != last_.back().pixels.size()) {
    return std::nullopt;
  }
  const std::vector<Template> prev(before.begin(), before.end());
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
    compare(best_shift(before.back(), last_.back()), kMuchBetter);
  }
  double sigma_px = 0.0;
  for (std::size_t i = prev.size(); i-- > 0;) {
    sigma_px = align_level(prev[i], last_[i], turn);
  }
  const double found = likeness(prev.front(), last_.front(), turn);
  if (!(sigma_px < kMaxTurnSigma_px) || !(found >= kMinLikeness)) {
    return std::nullopt;
  }
  const Eigen::Quaterniond guess = hint.value_or(expected_).conjugate();
  refutes_guess_ = guess.angularDistance(turn) * last_.front().focal_px.mean() > kSame_px &&
                   likeness(prev.front(), last_.front(), guess) < found - kMuchBetter;
  rad_per_s_ = so3_log(turn.conjugate()) / interval_s;
  return turn.conjugate();
}

}  // namespace stemvo
