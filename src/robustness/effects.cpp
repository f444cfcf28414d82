// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <numbers>

#include <opencv2/imgproc.hpp>

#include "internal_check.hpp"
#include "io/image_file.hpp"
#include "robustness/disturbance.hpp"

namespace stemvo::robustness {
namespace {

constexpr std::uint64_t kWholeDrive = UINT64_MAX;  // frame of what stays the same over a drive
constexpr double kPi = std::numbers::pi;

// Something goes from one side to the other in 30 of every 60 frames, the first 20 without.
constexpr std::size_t kOccluderPeriod = 60;
constexpr std::size_t kBeforeOccluder = 20;
constexpr std::size_t kOccluderPasses = 30;

/// Gray levels of the same image scaled: sizes in pixels are those of a KITTI frame.
double pixels(const cv::Mat& image, double of_1242) { return of_1242 * image.cols / 1242.0; }

/// Value by value, all channels alike.
template <typename Function>
void map_levels(cv::Mat& image, Function function) {
  cv::Mat table(1, 256, CV_8U);
  for (int level = 0; level < 256; ++level) {
    table.at<uchar>(level) = cv::saturate_cast<uchar>(function(level));
  }
  cv::LUT(image, table, image);
}

/// image = weight * image + (1 - weight) * gray; `weight` CV_32F of the image's size.
void blend(cv::Mat& image, const cv::Mat& weight, double gray) {
  cv::Mat weights;
  cv::merge(std::vector<cv::Mat>(static_cast<std::size_t>(image.channels()), weight), weights);
  cv::Mat values;
  image.convertTo(values, CV_32F);
  values = (values - cv::Scalar::all(gray)).mul(weights) + cv::Scalar::all(gray);
  values.convertTo(image, CV_8U);
}

cv::Mat normal_noise(const cv::Mat& like, cv::RNG& random) {
  cv::Mat noise(like.size(), CV_32FC(like.channels()));
  random.fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
  return noise;
}

/// Smooth gray levels of a surface that nobody has seen: for things that pass by.
cv::Mat texture(cv::Size size, int type, std::uint64_t seed) {
  cv::RNG random = random_of(seed, kWholeDrive);
  cv::Mat noise(size / 4 + cv::Size(2, 2), CV_8U);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::Mat image;
  cv::resize(noise, image, size, 0.0, 0.0, cv::INTER_CUBIC);
  if (CV_MAT_CN(type) == 3) {
    cv::cvtColor(image, image, cv::COLOR_GRAY2RGB);
  }
  return image;
}

void exposure_steps(cv::Mat& image, double strength, const EffectContext& context) {
  constexpr std::size_t kFramesBetween = 12;
  cv::RNG random = random_of(context.seed, context.frame / kFramesBetween);
  const double gain = std::pow(strength, random.uniform(-1.0, 1.0));
  map_levels(image, [gain](int level) { return gain * level; });
}

void exposure_drift(cv::Mat& image, double strength, const EffectContext& context) {
  constexpr double kPeriod_frames = 80.0;
  const double phase = 2.0 * kPi * static_cast<double>(context.frame) / kPeriod_frames;
  const double gain = std::pow(strength, -std::sin(phase));
  map_levels(image, [gain](int level) { return gain * level; });
}

void gamma(cv::Mat& image, double strength, const EffectContext& /*context*/) {
  map_levels(image, [strength](int level) { return 255.0 * std::pow(level / 255.0, strength); });
}

void vignette(cv::Mat& image, double strength, const EffectContext& context) {
  const Camera& camera = context.camera;
  const double corner2 = std::pow(0.5 * camera.width_px, 2) + std::pow(0.5 * camera.height_px, 2);
  cv::Mat weight(image.size(), CV_32F);
  for (int v = 0; v < weight.rows; ++v) {
    for (int u = 0; u < weight.cols; ++u) {
      const double radius2 = std::pow(u - 0.5 * image.cols, 2) + std::pow(v - 0.5 * image.rows, 2);
      weight.at<float>(v, u) = static_cast<float>(1.0 - strength * radius2 / corner2);
    }
  }
  blend(image, weight, 0.0);
}

/// A sensor of 4000 electrons at white and 3 electrons of read noise; photon noise is normal with
/// Poisson's variance.
void dusk(cv::Mat& image, double strength, const EffectContext& context) {
  constexpr double kFalls_frames = 50.0;
  constexpr double kWhite_electrons = 4000.0;
  constexpr double kRead_electrons = 3.0;
  cv::RNG random = random_of(context.seed, context.frame);
  cv::Mat electrons;
  const double light =
      std::pow(strength, std::min(1.0, static_cast<double>(context.frame) / kFalls_frames));
  image.convertTo(electrons, CV_32F, light * kWhite_electrons / 255.0);
  cv::Mat deviation;
  cv::sqrt(electrons + cv::Scalar::all(kRead_electrons * kRead_electrons), deviation);
  electrons += deviation.mul(normal_noise(image, random));
  electrons.convertTo(image, CV_8U, 255.0 / (kWhite_electrons * std::sqrt(light)));
}

void low_contrast(cv::Mat& image, double strength, const EffectContext& /*context*/) {
  map_levels(image, [strength](int level) { return 128.0 + strength * (level - 128.0); });
}

void sensor_noise(cv::Mat& image, double strength, const EffectContext& context) {
  cv::RNG random = random_of(context.seed, context.frame);
  cv::Mat values;
  image.convertTo(values, CV_32F);
  values += strength * normal_noise(image, random);
  values.convertTo(image, CV_8U);
}

void gaussian_blur(cv::Mat& image, double strength, const EffectContext& /*context*/) {
  cv::GaussianBlur(image, image, {}, pixels(image, strength));
}

void motion_blur(cv::Mat& image, double strength, const EffectContext& context) {
  constexpr int kSamples = 4;  // per pixel of the line
  cv::RNG random = random_of(context.seed, context.frame);
  const double angle_rad = random.uniform(0.0, kPi);
  const double length_px = pixels(image, strength);
  const int radius = static_cast<int>(std::ceil(0.5 * length_px));
  cv::Mat kernel = cv::Mat::zeros(2 * radius + 1, 2 * radius + 1, CV_32F);
  const int num_samples = std::max(1, static_cast<int>(kSamples * length_px));
  for (int i = 0; i < num_samples; ++i) {
    const double along_px = length_px * ((i + 0.5) / num_samples - 0.5);
    kernel.at<float>(radius + static_cast<int>(std::lround(along_px * std::sin(angle_rad))),
                     radius + static_cast<int>(std::lround(along_px * std::cos(angle_rad)))) +=
        1.0F;
  }
  cv::filter2D(image, image, -1, kernel / cv::sum(kernel)[0], {-1, -1}, 0.0, cv::BORDER_REFLECT);
}

void jpeg(cv::Mat& image, double strength, const EffectContext& /*context*/) {
  const std::string bytes = io::encode_jpeg(image, static_cast<int>(strength));
  const auto decoded =
      io::decode_image({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "jpeg",
                       image.channels() == 3);
  STEMVO_CHECK(decoded, "what was just encoded");
  image = *decoded;
}

/// Over a flat road 1.65 m below the camera, between walls 40 m away (Koschmieder's law: contrast
/// falls with exp(-3.9 d / visibility)).
void fog(cv::Mat& image, double strength, const EffectContext& context) {
  constexpr double kHeight_m = 1.65;
  constexpr double kWalls_m = 40.0;
  constexpr double kAir_gray = 190.0;
  cv::Mat weight(image.size(), CV_32F);
  for (int v = 0; v < image.rows; ++v) {
    const double below_px = v - context.camera.cy_px;
    const double road_m = below_px > 0.0 ? kHeight_m * context.camera.fy_px / below_px : kWalls_m;
    weight.row(v).setTo(std::exp(-3.9 * std::min(road_m, kWalls_m) / strength));
  }
  blend(image, weight, kAir_gray);
}

void rain(cv::Mat& image, double strength, const EffectContext& context) {
  cv::RNG random = random_of(context.seed, context.frame);
  cv::Mat streaks = cv::Mat::zeros(image.size(), CV_8U);
  const double area = pixels(image, 1.0) * image.rows / 375.0;  // a KITTI frame's is 1
  for (int i = 0; i < static_cast<int>(std::lround(strength * area)); ++i) {
    const double u = random.uniform(0.0, 1.0 * image.cols);
    const double v = random.uniform(-20.0, 1.0 * image.rows);
    const cv::Point2d from(u, v);
    const double length_px = pixels(image, random.uniform(10.0, 40.0));
    const double lean = 0.15 + random.uniform(-0.05, 0.05);
    cv::line(streaks, from, from + length_px * cv::Point2d(lean, 1.0),
             cv::Scalar(random.uniform(40, 120)), 1, cv::LINE_AA);
  }
  cv::Mat weight;
  streaks.convertTo(weight, CV_32F, -1.0 / 255.0, 1.0);
  blend(image, weight, 220.0);
}

void shadows(cv::Mat& image, double strength, const EffectContext& context) {
  constexpr double kWidth = 140.0;
  constexpr double kPerFrame = 9.0;
  cv::Mat weight(image.size(), CV_32F);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const double along =
          u + 0.5 * v + pixels(image, kPerFrame) * static_cast<double>(context.frame);
      const bool is_shaded = std::fmod(along, pixels(image, 2.0 * kWidth)) < pixels(image, kWidth);
      weight.at<float>(v, u) = is_shaded ? static_cast<float>(1.0 - strength) : 1.0F;
    }
  }
  cv::GaussianBlur(weight, weight, {}, pixels(image, 2.0));
  blend(image, weight, 0.0);
}

void dirt(cv::Mat& image, double strength, const EffectContext& context) {
  cv::RNG random = random_of(context.seed, kWholeDrive);
  cv::Mat weight(image.size(), CV_32F, cv::Scalar(1.0));
  while (1.0 - cv::mean(weight)[0] < strength) {
    const int u = random.uniform(0, image.cols);
    const int v = random.uniform(0, image.rows);
    cv::circle(weight, {u, v}, static_cast<int>(pixels(image, random.uniform(10.0, 45.0))),
               cv::Scalar(0.0), cv::FILLED);
  }
  cv::GaussianBlur(weight, weight, {}, pixels(image, 5.0));
  blend(image, weight, 60.0);
}

bool occluder_passes(std::size_t frame, double /*strength*/) {
  const std::size_t step = frame % kOccluderPeriod;
  return step >= kBeforeOccluder && step < kBeforeOccluder + kOccluderPasses;
}

void occluder(cv::Mat& image, double strength, const EffectContext& context) {
  const cv::Size size(static_cast<int>(strength * image.cols), image.rows);
  const double share = static_cast<double>(context.frame % kOccluderPeriod - kBeforeOccluder) /
                       (kOccluderPasses - 1);
  const cv::Rect place(
      {static_cast<int>(std::lround(share * (image.cols + size.width))) - size.width, 0}, size);
  const cv::Rect seen = place & cv::Rect({}, image.size());
  if (!seen.empty()) {
    texture(size, image.type(), context.seed)(seen - place.tl()).copyTo(image(seen));
  }
}

void moving_third(cv::Mat& image, double strength, const EffectContext& context) {
  const int width = image.cols / 3;
  const cv::Mat whole = texture({2 * width, image.rows}, image.type(), context.seed);
  const double moved_px = pixels(image, strength) * static_cast<double>(context.frame);
  const int shift =
      static_cast<int>(std::lround(std::abs(std::fmod(moved_px, 2.0 * width) - width)));
  whole({shift, 0, width, image.rows}).copyTo(image({width, 0, width, image.rows}));
}

bool is_black(std::size_t frame, double strength) {
  constexpr std::size_t kPeriod = 100;
  constexpr std::size_t kBefore = 30;
  const std::size_t step = frame % kPeriod;
  return step >= kBefore && step < kBefore + static_cast<std::size_t>(strength);
}

void blackout(cv::Mat& image, double /*strength*/, const EffectContext& /*context*/) {
  image.setTo(0);
}

}  // namespace

cv::RNG random_of(std::uint64_t seed, std::uint64_t frame) {
  // SplitMix64 (Steele, Lea, Flood 2014): neighbours' generators have nothing in common.
  std::uint64_t state = seed * 0x9E3779B97F4A7C15U + frame;
  state = (state ^ (state >> 30U)) * 0xBF58476D1CE4E5B9U;
  state = (state ^ (state >> 27U)) * 0x94D049BB133111EBU;
  return cv::RNG(state ^ (state >> 31U));
}

std::vector<Disturbance> effects() {
  return {
      {"exposure_steps",
       "light",
       "gain jumps every 12 frames, up to this factor",
       {1.2, 1.5, 2.0},
       exposure_steps},
      {"exposure_drift",
       "light",
       "gain swings slowly up to this factor",
       {1.5, 2.0, 3.0},
       exposure_drift},
      {"gamma", "light", "gray levels to this power", {1.5, 2.2, 3.0}, gamma},
      {"vignette",
       "light",
       "this share of the light is lost in the corners",
       {0.3, 0.6, 0.9},
       vignette},
      {"dusk",
       "noise",
       "the light falls to this share in 50 frames, photon and read noise; gain makes up for half "
       "of the stops",
       {0.1, 0.03, 0.01},
       dusk},
      {"low_contrast",
       "light",
       "this share of the contrast is left",
       {0.5, 0.25, 0.1},
       low_contrast},
      {"sensor_noise",
       "noise",
       "normal noise of this many gray levels",
       {6.0, 12.0, 24.0},
       sensor_noise},
      {"gaussian_blur",
       "blur",
       "of this sigma, pixels of a frame 1242 wide",
       {1.0, 2.0, 3.0},
       gaussian_blur},
      {"motion_blur",
       "blur",
       "along a line so long, of another direction in each frame",
       {5.0, 11.0, 21.0},
       motion_blur},
      {"jpeg", "noise", "compressed at this quality", {30.0, 15.0, 7.0}, jpeg},
      {"fog",
       "weather",
       "visible so far, metres, on a flat road between walls 40 m away",
       {100.0, 50.0, 25.0},
       fog},
      {"rain", "weather", "so many streaks per frame of 1242x375", {200.0, 600.0, 1500.0}, rain},
      {"shadows",
       "light",
       "bands that move over the image take this share of the light",
       {0.3, 0.5, 0.7},
       shadows},
      {"dirt",
       "in the way",
       "blots on the lens over this share of the image",
       {0.05, 0.1, 0.2},
       dirt},
      {"occluder",
       "in the way",
       "something passes before the camera, of this share of the image",
       {0.1, 0.2, 0.4},
       occluder,
       nullptr,
       occluder_passes},
      {"moving_third",
       "in the way",
       "a third of the image moves on its own, pixels per frame",
       {2.0, 5.0, 10.0},
       moving_third},
      {"blackout",
       "in the way",
       "no light in so many of 100 frames",
       {3.0, 10.0, 20.0},
       blackout,
       nullptr,
       is_black},
  };
}

}  // namespace stemvo::robustness
