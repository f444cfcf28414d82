// SPDX-License-Identifier: MIT
#include "mapping/descriptors.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace stemvo {
namespace {

/// A match differs in at most so many of the 256 bits; two that do not belong together in 128, most
/// of them in more than 80.
constexpr int kMaxBits = 72;
/// So much nearer than the next one.
constexpr double kMaxRatio = 0.85;
/// A turn by half of it costs few bits.
constexpr double kRollStep_rad = 0.1;
/// Side of the square that the comparisons lie in, pixels of the channel.
constexpr int kPatch_px = 31;
/// It lies in the image.
constexpr int kBorder_px = kPatch_px / 2 + 1;

struct Nearest {
  int index = -1;
  int num_bits = std::numeric_limits<int>::max();
  int next_bits = std::numeric_limits<int>::max();

  void add(int other, int bits) {
    if (bits < num_bits) {
      next_bits = num_bits;
      num_bits = bits;
      index = other;
    } else {
      next_bits = std::min(next_bits, bits);
    }
  }
  [[nodiscard]] bool is_clear() const {
    return num_bits <= kMaxBits && num_bits < kMaxRatio * next_bits;
  }
};

STEMVO_INLINE void find_nearest(std::span<const Descriptor> first,
                                std::span<const Descriptor> second,
                                std::vector<Nearest>& of_first,
                                std::vector<Nearest>& of_second) {
  for (std::size_t i = 0; i < first.size(); ++i) {
    if (first[i] == kNoDescriptor) {
      continue;
    }
    for (std::size_t j = 0; j < second.size(); ++j) {
      const int num_bits = differing_bits(first[i], second[j]);
      of_first[i].add(static_cast<int>(j), num_bits);
      of_second[j].add(static_cast<int>(i), num_bits);
    }
  }
}

}  // namespace

double image_roll_rad(const Eigen::Quaterniond& map_from_camera) {
  const Eigen::Vector3d y_axis = map_from_camera.conjugate() * Eigen::Vector3d::UnitY();
  return std::atan2(-y_axis.x(), y_axis.y());
}

std::vector<Descriptor> describe(const ChannelImage& channel,
                                 std::span<const KeptCorner> corners,
                                 double roll_rad,
                                 double scale) {
  const auto roll_deg = static_cast<float>(roll_rad * 180.0 / M_PI);
  cv::Mat pixels = channel.pixels;
  if (scale != 1.0) {
    cv::resize(channel.pixels, pixels, {}, scale, scale,
               scale < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  }
  std::vector<cv::KeyPoint> keypoints;
  for (const KeptCorner& corner : corners) {
    // The middle of the first pixel is at (0, 0).
    const Eigen::Vector2d at = channel.map.from_input(corner.uv.cast<double>());
    const Eigen::Vector2f scaled = (scale * (at.array() + 0.5) - 0.5).cast<float>();
    const int index = static_cast<int>(keypoints.size());
    keypoints.emplace_back(cv::Point2f(scaled.x(), scaled.y()), kPatch_px, roll_deg, 0.0F, 0,
                           index);
  }
  const cv::Ptr<cv::ORB> orb =
      cv::ORB::create(std::max(1, static_cast<int>(corners.size())), 2.0F, 1, kBorder_px, 0, 2,
                      cv::ORB::HARRIS_SCORE, kPatch_px);
  cv::Mat bits;
  orb->compute(pixels, keypoints, bits);
  std::vector<Descriptor> descriptors(corners.size());
  for (int row = 0; row < bits.rows; ++row) {
    const int index = keypoints[static_cast<std::size_t>(row)].class_id;
    std::memcpy(&descriptors[static_cast<std::size_t>(index)], bits.ptr(row), sizeof(Descriptor));
  }
  return descriptors;
}

std::span<const Descriptor> LookDescriptors::for_view(double magnification, double roll_rad) {
  const auto off = [&](double scale) { return std::abs(std::log(scale * magnification)); };
  const auto* const best = std::ranges::min_element(kOtherScales, {}, off);
  const double roll = std::remainder(roll_rad, 2.0 * M_PI);
  return other(
      {off(*best) < off(1.0) ? *best : 1.0, kRollStep_rad * std::round(roll / kRollStep_rad)});
}

std::vector<DescriptorPair> match_descriptors(std::span<const Descriptor> first,
                                              std::span<const Descriptor> second) {
  std::vector<Nearest> of_first(first.size());
  std::vector<Nearest> of_second(second.size());
  run_body<find_nearest>(first, second, of_first, of_second);
  std::vector<DescriptorPair> pairs;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const Nearest& nearest = of_first[i];
    if (nearest.index < 0 || !nearest.is_clear()) {
      continue;
    }
    const Nearest& back = of_second[static_cast<std::size_t>(nearest.index)];
    if (back.index == static_cast<int>(i) && back.is_clear() &&
        second[static_cast<std::size_t>(nearest.index)] != kNoDescriptor) {
      pairs.emplace_back(static_cast<int>(i), nearest.index);
    }
  }
  return pairs;
}

}  // namespace stemvo
