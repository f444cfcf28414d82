// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core.hpp>

#include "dataset/frame_source.hpp"

namespace stemvo::robustness {

/// Facts about one frame that an effect may depend on. The same numbers give the same image.
struct EffectContext {
  std::size_t frame = 0;  ///< counted from the drive's first
  std::uint64_t seed = 0;
  Camera camera;  ///< of the frame
};

/// A kind of disturbance, at three strengths, weakest first.
struct Disturbance {
  std::string_view name;    ///< a word for tables, e.g. "gaussian_blur"
  std::string_view group;   ///< of kinds that are summed up together, e.g. "blur"
  std::string_view effect;  ///< what happens to the frames, and what the strengths are
  std::array<double, 3> strengths;
  /// Frame -> frame; null where frames are left out, repeated, or seen by another camera.
  void (*apply)(cv::Mat& image, double strength, const EffectContext& context) = nullptr;
  /// Source -> source of other frames; null where `apply` is not.
  FrameSource (*resample)(const FrameSource& source, double strength, std::uint64_t seed) = nullptr;
  /// Whether a frame is disturbed; null: all are.
  bool (*is_on)(std::size_t frame, double strength) = nullptr;

  /// Whether it changes a frame of a drive of so many, calm end included.
  [[nodiscard]] bool disturbs(std::size_t frame, std::size_t num_frames, double strength) const;
};

/// All kinds: light, noise and blur, weather, things in the way, other frames.
[[nodiscard]] const std::vector<Disturbance>& disturbances();

/// Null: there is none of that name.
[[nodiscard]] const Disturbance* find_disturbance(std::string_view name);
/// "dusk, fog, .."
[[nodiscard]] std::string names_of_disturbances();

/// At the end of a drive effects cease for so many frames, to see how soon the camera is found
/// again: 30, of short drives an eighth.
[[nodiscard]] std::size_t num_calm_frames(std::size_t num_frames);

/// The source as it is disturbed, deterministic by seed and frame, whoever reads in which order.
/// `index` of `strengths`. Ground truth and times stay with their frames.
[[nodiscard]] FrameSource disturb(const FrameSource& source,
                                  const Disturbance& disturbance,
                                  std::size_t index,
                                  std::uint64_t seed);

/// Random numbers of one frame (`frame`: any number where all frames share them).
[[nodiscard]] cv::RNG random_of(std::uint64_t seed, std::uint64_t frame);

/// Disturbances with `apply`, and those with `resample`.
[[nodiscard]] std::vector<Disturbance> effects();
[[nodiscard]] std::vector<Disturbance> resamplings();

}  // namespace stemvo::robustness
