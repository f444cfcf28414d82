// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "stemvo/error.hpp"
#include "stemvo/options.hpp"

/// One visit() per struct of options tells every key: visitors of (section, key, value, rule, help)
/// write, read, check and explain options, which may be const.
namespace stemvo::options {

/// The values a key may have. Bounds hold for every element of a list; infinite and NaN never pass.
struct Rule {
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double min = -kInfinity;
  double max = kInfinity;
  bool odd = false;
  std::vector<std::string_view> choices;  ///< of a text; empty: any text but the empty one

  static Rule between(double min, double max) { return {min, max, false, {}}; }
  static Rule odd_between(double min, double max) { return {min, max, true, {}}; }
  static Rule one_of(std::vector<std::string_view> choices) {
    return {-kInfinity, kInfinity, false, std::move(choices)};
  }
};

template <typename... Text>
constexpr std::array<std::string_view, sizeof...(Text)> names(Text... text) {
  return {text...};
}
/// Names of the enumerators, by their numbers.
constexpr auto names_of(TrackingResolution) {
  return names("auto", "input", "input_zoomed", "half", "native");
}
constexpr auto names_of(FeatureMethod) { return names("patch", "klt", "orb", "sift"); }
constexpr auto names_of(RobustEstimator) { return names("magsac", "ransac"); }
constexpr auto names_of(OdometryMode) { return names("two_frame", "map"); }
constexpr auto names_of(Composition) { return names("right", "paper"); }
constexpr auto names_of(ForwardGate) { return names("paper", "off"); }
constexpr auto names_of(CameraRefinement) { return names("off", "principal_point", "all"); }
constexpr auto names_of(ScaleSource) { return names("none", "constant_speed", "camera_height"); }
constexpr auto names_of(RoadEstimators) { return names("both", "dense", "points"); }
template <typename Enum>
inline constexpr auto kNames = names_of(Enum{});

template <typename T>
concept Enumeration = std::is_enum_v<T>;
template <typename T>
concept Number = std::is_arithmetic_v<T> && !std::is_same_v<T, bool>;

template <Enumeration Enum>
[[nodiscard]] std::string_view to_string(Enum value) {
  return kNames<Enum>.at(static_cast<std::size_t>(value));
}
/// An unknown name gives no enumerator, which validate() refuses.
template <Enumeration Enum>
[[nodiscard]] Enum from_string(std::string_view name) {
  return static_cast<Enum>(std::ranges::find(kNames<Enum>, name) - kNames<Enum>.begin());
}

/// "section.key", or the key alone at the top level.
[[nodiscard]] std::string full_name(std::string_view section, std::string_view key);

/// "expected ..., found ..." where the rule refuses the value, else nothing.
[[nodiscard]] std::string number_violation(std::string_view kind, double value, const Rule& rule);
template <typename N>
  requires std::is_arithmetic_v<N>
[[nodiscard]] std::string violation_of(N value, const Rule& rule) {
  return number_violation(std::is_floating_point_v<N> ? "a number" : "a whole number",
                          static_cast<double>(value), rule);
}
[[nodiscard]] std::string violation_of(const std::vector<double>& values, const Rule& rule);
[[nodiscard]] std::string violation_of(const std::string& value, const Rule& rule);
template <Enumeration Enum>
[[nodiscard]] std::string violation_of(Enum value, const Rule&) {
  const auto number = static_cast<std::size_t>(value);
  const Rule names = Rule::one_of({kNames<Enum>.begin(), kNames<Enum>.end()});
  return violation_of(number < names.choices.size() ? std::string(names.choices[number])
                                                    : fmt::format("number {}", number),
                      names);
}

/// Visitor that keeps the first violation, with its key in front.
struct Checker {
  template <typename Value>
  void operator()(std::string_view section,
                  std::string_view key,
                  const Value& value,
                  const Rule& rule,
                  std::string_view /*help*/) {
    const std::string problem = status ? violation_of(value, rule) : "";
    if (!problem.empty()) {
      status = fail(full_name(section, key) + ": " + problem);
    }
  }
  Status status;
};

template <typename T, typename Struct>
concept Is = std::derived_from<std::remove_const_t<T>, Struct>;

inline const Rule kAny;
inline const Rule kPixels = Rule::between(1e-3, 1000);

template <Is<StemOptions> O, typename V>
void visit(O& o, V&& v) {
  v("model", o.model, kAny,
    "default, default_filter_0 or paper (built in), path of an .onnx, or made by hand, to compare "
    "with: gray, log "
    "(Laplacian of Gaussian), census (local contrast), input_layer (filters 0-2 = R, G, B)");
  v("filter", o.filter, Rule::between(-1, 1000000),
    "the one filter whose response is the image; -1: the default_filter of the model");
  v("sampling_px", o.sampling_px, Rule::between(0, 4096),
    "input pixels per channel pixel, a divisor of the network's stride; 0: 2 where it divides the "
    "stride, else 1");
  v("tracking_resolution", o.tracking_resolution, kAny,
    "size of the image to track on: input (the input's), input_zoomed (the same, the frame "
    "enlarged before the filter), half (of the input's), native (the channel's), or auto: for "
    "patch and klt half where the focal length is 500 px or more, else input_zoomed; for orb and "
    "sift input");
  v("contrast_low_percent", o.contrast_low_percent, Rule::between(0, 100),
    "percentile of the response that becomes black");
  v("contrast_high_percent", o.contrast_high_percent, Rule::between(0, 100),
    "percentile of the response that becomes white");
  v("contrast_memory", o.contrast_memory, Rule::between(0, 1),
    "share of the last frame's black and white kept, so that gray values stay put");
}

template <Is<FeatureOptions> O, typename V>
void visit(O& o, V&& v) {
  v("method", o.method, kAny,
    "patch: corners tracked by the patch of their first frame; klt: by optical flow from frame to "
    "frame; orb (the paper's), sift: described and matched");
  v("max_features", o.max_features, Rule::between(8, 100000), "keypoints aimed at per frame");
  v("grid_columns", o.grid_columns, Rule::between(1, 1000),
    "cells across the image, each with its share of the keypoints");
  v("grid_rows", o.grid_rows, Rule::between(1, 1000), "cells down the image");
  v("corner_quality", o.corner_quality, Rule::between(1e-6, 1),
    "patch, klt: least corner response, as a share of the strongest");
  v("min_distance_px", o.min_distance_px, Rule::between(0, 1000),
    "patch, klt: between keypoints, input pixels");
  v("klt_window", o.klt_window, Rule::odd_between(3, 201),
    "klt: side of the window, input pixels, odd; at least 7 pixels of the tracked image");
  v("klt_levels", o.klt_levels, Rule::between(1, 10),
    "patch, klt: levels of the pyramid, from the input's size on; patch: one more where few "
    "points are found");
  v("max_forward_backward_px", o.max_forward_backward_px, kPixels,
    "klt: a point tracked there and back must return this close, input pixels");
  v("fast_threshold", o.fast_threshold, Rule::between(1, 254),
    "orb: least step of gray value of a corner");
  v("ratio", o.ratio, Rule::between(0, 1),
    "sift: distance of the best match over that of the second best");
}

template <Is<TwoViewOptions> O, typename V>
void visit(O& o, V&& v) {
  v("sigma_px", o.sigma_px, kPixels, "noise in the scores S_H and S_F of eq. (5), input pixels");
  v("homography_ratio", o.homography_ratio, Rule::between(0, 1),
    "R_H of eq. (7) above it: the initial pose comes from the homography");
  v("estimator", o.estimator, kAny, "robust estimator");
  v("inlier_threshold_px", o.inlier_threshold_px, kPixels,
    "epipolar distance of an inlier, for the robust estimator, input pixels");
  v("confidence", o.confidence, Rule::between(0.5, 0.999999999),
    "probability that the robust estimator has drawn a good sample");
  v("max_iterations", o.max_iterations, Rule::between(1, 10000000),
    "most iterations of the robust estimator");
  v("refine", o.refine, kAny, "nonlinear refinement of the motion on the inliers");
  v("refine_loss_px", o.refine_loss_px, kPixels,
    "epipolar distance from which the refinement mistrusts a match, input pixels");
}

template <Is<OdometryOptions> O, typename V>
void visit(O& o, V&& v) {
  v("mode", o.mode, kAny,
    "two_frame: motions of pairs of frames are chained; map: each frame is localized against the "
    "landmarks of a window of keyframes, which are refined together");
  v("composition", o.composition, kAny,
    "two_frame: how steps are chained: right, R_c R; paper, R R_c as printed in eq. (12)");
  v("gate", o.gate, kAny,
    "two_frame: what a step that does not go forward loses: paper: its translation and rotation; "
    "off: nothing");
  v("min_inliers", o.min_inliers, Rule::between(5, 100000), "fewer: the frame is lost");
  v("stationary_flow_px", o.stationary_flow_px, Rule::between(0, 1000),
    "median flow below it: stationary, input pixels");
  v("min_parallax_px", o.min_parallax_px, Rule::between(0, 1000),
    "median flow without the rotation's below it: low parallax, too little to see a direction, "
    "input pixels");
  v("loops", o.loops, kAny,
    "map: places are remembered and recognized, when the camera comes back and after a loss");
}

template <Is<KeyframeWindowOptions> O, typename V>
void visit(O& o, V&& v) {
  v("num_keyframes", o.num_keyframes, Rule::between(3, 100),
    "keyframes whose landmarks frames are localized against, refined together");
}

template <Is<BaOptions> O, typename V>
void visit(O& o, V&& v) {
  v("every_n_keyframes", o.every_n_keyframes, Rule::between(0, 1000000),
    "keyframes between bundle adjustments of the window, the paper's m; 0: never");
  v("max_iterations", o.max_iterations, Rule::between(1, 1000),
    "most iterations of one bundle adjustment");
  v("loss_px", o.loss_px, kPixels,
    "reprojection error from which an observation is mistrusted, input pixels");
}

template <Is<CameraOptions> O, typename V>
void visit(O& o, V&& v) {
  v("refine", o.refine, kAny,
    "mode map: what of the given camera is refined while driving, where the images insist: off "
    "(nothing), principal_point (and the distortion that is left), or all (the focal length too)");
}

template <Is<ScaleOptions> O, typename V>
void visit(O& o, V&& v) {
  v("source", o.source, kAny,
    "length of a step: none, up to scale (1 unit; mode map: the first one); constant_speed, the "
    "same in metres; camera_height, from the road; the program alone: auto, camera_height on a "
    "KITTI folder and where a height is given, else none; ground_truth, each output step rescaled "
    "(the paper's protocol; needs the pose file)");
  v("step_m", o.step_m, Rule::between(1e-6, 1e6), "metres per frame, for constant_speed");
  v("camera_height_m", o.camera_height_m, Rule::between(0.01, 1000),
    "above the road, for camera_height");
  v("estimators", o.estimators, kAny,
    "camera_height: what measures the road: dense (its image aligned), points (tracked corners; "
    "the first frames are dense all the same), or both");
}

template <Is<Options> O, typename V>
void visit(O& o, V&& v) {
  const auto section = [&v](std::string_view name) {
    return [&v, name](std::string_view key, auto& value, const Rule& rule, std::string_view help) {
      v(name, key, value, rule, help);
    };
  };
  visit(o.stem, section("stem"));
  visit(o.features, section("features"));
  visit(o.two_view, section("two_view"));
  visit(o.odometry, section("odometry"));
  visit(o.window, section("window"));
  visit(o.ba, section("ba"));
  visit(o.camera, section("camera"));
  visit(o.scale, section("scale"));
  v("", "seed", o.seed, kAny, "seed of every random number");
  v("", "threads", o.threads, Rule::between(0, 1024),
    "threads at work at a time, which no pose depends on; 0: one per core");
}

}  // namespace stemvo::options
