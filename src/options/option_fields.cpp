// SPDX-License-Identifier: MIT
#include "options/option_fields.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace stemvo::options {
namespace {

/// Of what is measured in pixels and must not be zero.
const Rule kPixels = Rule::between(1e-3, 1000);
const Rule kAny;

std::vector<Field> stem_fields(StemOptions& o) {
  return {
      {"stem", "model", &o.model, kAny,
       "default or paper (built in), path of an .onnx, or made by hand, to compare with: gray, log "
       "(Laplacian of Gaussian), census (local contrast), input_layer (filters 0-2 = R, G, B)"},
      {"stem", "filter", &o.filter, Rule::between(-1, 1000000),
       "the one filter whose response is the image; -1: the default_filter of the model"},
      {"stem", "sampling_px", &o.sampling_px, Rule::between(0, 4096),
       "input pixels per channel pixel, a divisor of the network's stride; 0: 2 where it "
       "divides the stride, else 1"},
      {"stem", "tracking_resolution", enum_value(&o.tracking_resolution),
       Rule::one_of({"auto", "input", "input_zoomed", "half", "native"}),
       "size of the image to track on: input (the input's), input_zoomed (the same, the frame "
       "enlarged before the filter), half (of the input's), native (the channel's), or auto: for "
       "patch and klt half where the focal length is 500 px or more, else input_zoomed; for orb "
       "and "
       "sift input"},
      {"stem", "contrast_low_percent", &o.contrast_low_percent, Rule::between(0, 100),
       "percentile of the response that becomes black"},
      {"stem", "contrast_high_percent", &o.contrast_high_percent, Rule::between(0, 100),
       "percentile of the response that becomes white"},
      {"stem", "contrast_memory", &o.contrast_memory, Rule::between(0, 1),
       "share of the last frame's black and white kept, so that gray values stay put"},
  };
}

std::vector<Field> feature_fields(FeatureOptions& o) {
  return {
      {"features", "method", enum_value(&o.method),
       Rule::one_of({kFeatureMethods.begin(), kFeatureMethods.end()}),
       "patch: corners tracked by the patch of their first frame; klt: by optical flow from frame "
       "to "
       "frame; orb (the paper's), sift: described and matched"},
      {"features", "max_features", &o.max_features, Rule::between(8, 100000),
       "keypoints aimed at per frame"},
      {"features", "grid_columns", &o.grid_columns, Rule::between(1, 1000),
       "cells across the image, each with its share of the keypoints"},
      {"features", "grid_rows", &o.grid_rows, Rule::between(1, 1000), "cells down the image"},
      {"features", "corner_quality", &o.corner_quality, Rule::between(1e-6, 1),
       "patch, klt: least corner response, as a share of the strongest"},
      {"features", "min_distance_px", &o.min_distance_px, Rule::between(0, 1000),
       "patch, klt: between keypoints, input pixels"},
      {"features", "klt_window", &o.klt_window, Rule::odd_between(3, 201),
       "klt: side of the window, input pixels, odd; at least 7 pixels of the tracked image"},
      {"features", "klt_levels", &o.klt_levels, Rule::between(1, 10),
       "patch, klt: levels of the pyramid, from the input's size on; patch: one more where few "
       "points are found"},
      {"features", "max_forward_backward_px", &o.max_forward_backward_px, kPixels,
       "klt: a point tracked there and back must return this close, input pixels"},
      {"features", "fast_threshold", &o.fast_threshold, Rule::between(1, 254),
       "orb: least step of gray value of a corner"},
      {"features", "ratio", &o.ratio, Rule::between(0, 1),
       "sift: distance of the best match over that of the second best"},
  };
}

std::vector<Field> two_view_fields(TwoViewOptions& o) {
  return {
      {"two_view", "sigma_px", &o.sigma_px, kPixels,
       "noise in the scores S_H and S_F of eq. (5), input pixels"},
      {"two_view", "homography_ratio", &o.homography_ratio, Rule::between(0, 1),
       "R_H of eq. (7) above it: the initial pose comes from the homography"},
      {"two_view", "estimator", enum_value(&o.estimator), Rule::one_of({"magsac", "ransac"}),
       "robust estimator"},
      {"two_view", "inlier_threshold_px", &o.inlier_threshold_px, kPixels,
       "of the robust estimator, input pixels"},
      {"two_view", "confidence", &o.confidence, Rule::between(0.5, 0.999999999),
       "of the robust estimator: probability that a good sample was drawn"},
      {"two_view", "max_iterations", &o.max_iterations, Rule::between(1, 10000000),
       "of the robust estimator"},
      {"two_view", "refine", &o.refine, kAny, "nonlinear refinement of the motion on the inliers"},
      {"two_view", "refine_loss_px", &o.refine_loss_px, kPixels,
       "epipolar distance from which the refinement mistrusts a match, input pixels"},
  };
}

std::vector<Field> odometry_fields(OdometryOptions& o) {
  return {
      {"odometry", "mode", enum_value(&o.mode), Rule::one_of({"two_frame", "map"}),
       "two_frame: motions of pairs of frames are chained; map: each frame is localized "
       "against the landmarks of a window of keyframes, which are refined together"},
      {"odometry", "composition", enum_value(&o.composition), Rule::one_of({"right", "paper"}),
       "how steps are chained: right, R_c R; paper, R R_c as printed in eq. (12)"},
      {"odometry", "gate", enum_value(&o.gate), Rule::one_of({"translation", "paper", "off"}),
       "two_frame: what a step that does not go forward loses: its translation, paper: its "
       "rotation "
       "too; off: nothing"},
      {"odometry", "min_inliers", &o.min_inliers, Rule::between(5, 100000),
       "fewer: the frame is lost"},
      {"odometry", "stationary_flow_px", &o.stationary_flow_px, Rule::between(0, 1000),
       "median flow below it: stationary, input pixels"},
      {"odometry", "min_parallax_px", &o.min_parallax_px, Rule::between(0, 1000),
       "median flow without the rotation's below it: low parallax, too little to see a direction, "
       "input pixels"},
  };
}

std::vector<Field> window_fields(KeyframeWindowOptions& o) {
  return {
      {"window", "num_keyframes", &o.num_keyframes, Rule::between(3, 100),
       "keyframes whose landmarks frames are localized against, refined together"},
  };
}

std::vector<Field> ba_fields(BaOptions& o) {
  return {
      {"ba", "every_n_keyframes", &o.every_n_keyframes, Rule::between(0, 1000000),
       "keyframes between bundle adjustments of the window, the paper's m; 0: never"},
      {"ba", "max_iterations", &o.max_iterations, Rule::between(1, 1000),
       "of one bundle adjustment"},
      {"ba", "loss_px", &o.loss_px, kPixels,
       "reprojection error from which an observation is mistrusted, input pixels"},
  };
}

std::vector<Field> camera_fields(CameraOptions& o) {
  return {
      {"camera", "refine", enum_value(&o.refine), Rule::one_of({"off", "principal_point", "all"}),
       "mode map: what of the given camera is refined while driving, where the images insist: off "
       "(nothing), principal_point, or all (the focal length too)"},
  };
}

std::vector<Field> scale_fields(ScaleOptions& o) {
  return {
      {"scale", "source", enum_value(&o.source),
       Rule::one_of({kScaleSources.begin(), kScaleSources.end()}),
       "length of a step: none, up to scale (1 unit; mode map: the first one); constant_speed, the "
       "same in metres; camera_height, from the road; ground_truth, each output step rescaled (the "
       "paper's protocol; needs the pose file)"},
      {"scale", "step_m", &o.step_m, Rule::between(1e-6, 1e6),
       "metres per frame, for constant_speed"},
      {"scale", "camera_height_m", &o.camera_height_m, Rule::between(0.01, 1000),
       "above the road, for camera_height"},
      {"scale", "estimators", enum_value(&o.estimators), Rule::one_of({"both", "dense", "points"}),
       "camera_height: what measures the road: dense (its image aligned), points (tracked "
       "corners; the first frames are dense all the same), or both"},
      {"scale", "temporal_filter", &o.temporal_filter, kAny,
       "camera_height: measurements are filtered over time; false: each frame's stands alone"},
  };
}

std::string describe(const Rule& rule, bool is_whole) {
  const std::string_view kind = is_whole ? "a whole number" : "a number";
  const std::string odd = rule.odd ? "odd, " : "";
  if (std::isfinite(rule.min) && std::isfinite(rule.max)) {
    return fmt::format("{} {}from {} to {}", kind, odd, rule.min, rule.max);
  }
  return std::string(kind);
}

/// Written so that NaN fails.
bool is_inside(const Rule& rule, double value) {
  const bool is_odd = !rule.odd || std::fmod(std::abs(value), 2.0) == 1.0;
  return std::isfinite(value) && value >= rule.min && value <= rule.max && is_odd;
}

std::string number_violation(const Rule& rule, double value, bool is_whole) {
  if (is_inside(rule, value)) {
    return {};
  }
  return fmt::format("expected {}, found {}", describe(rule, is_whole), value);
}

std::string text_violation(const Rule& rule, const std::string& value) {
  if (rule.choices.empty()) {
    return value.empty() ? "expected a text, found nothing" : std::string();
  }
  const bool is_known =
      std::find(rule.choices.begin(), rule.choices.end(), value) != rule.choices.end();
  return is_known ? std::string() : not_a_choice(rule, value);
}

std::string enum_violation(const Rule& rule, const EnumValue& value) {
  const int number = value.get(value.target);
  const bool is_known = number >= 0 && number < std::ssize(rule.choices);
  return is_known ? std::string() : not_a_choice(rule, fmt::format("number {}", number));
}

}  // namespace

std::vector<Field> fields_of(Options& options) {
  std::vector<Field> fields;
  const auto append = [&fields](std::vector<Field> section) {
    std::move(section.begin(), section.end(), std::back_inserter(fields));
  };
  append(stem_fields(options.stem));
  append(feature_fields(options.features));
  append(two_view_fields(options.two_view));
  append(odometry_fields(options.odometry));
  append(window_fields(options.window));
  append(ba_fields(options.ba));
  append(camera_fields(options.camera));
  append(scale_fields(options.scale));
  append({{"", "seed", &options.seed, {}, "of every random number"}});
  return fields;
}

std::string quote(std::string_view text) {
  constexpr std::size_t kMaxLength = 60;
  std::string shown(text.substr(0, kMaxLength));
  for (char& c : shown) {
    c = static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return "'" + shown + (text.size() > kMaxLength ? "...'" : "'");
}

std::string not_a_choice(const Rule& rule, std::string_view text) {
  return fmt::format("expected one of {}, found {}", fmt::join(rule.choices, ", "), quote(text));
}

std::string violation_of(const Field& field) {
  const Rule& rule = field.rule;
  return std::visit(
      Overloaded{
          [&](const EnumValue& value) { return enum_violation(rule, value); },
          [&](const std::string* value) { return text_violation(rule, *value); },
          [&](const int* value) { return number_violation(rule, *value, true); },
          [&](const double* value) { return number_violation(rule, *value, false); },
          [&](const std::vector<double>* values) {
            const auto wrong = std::ranges::find_if_not(
                *values, [&](double value) { return is_inside(rule, value); });
            return wrong == values->end() ? std::string() : number_violation(rule, *wrong, false);
          },
          [](const auto*) { return std::string(); },  // the seed, and yes or no, are never wrong
      },
      field.value);
}

Status check(const std::vector<Field>& fields) {
  for (const Field& field : fields) {
    if (const std::string problem = violation_of(field); !problem.empty()) {
      return fail(field.name() + ": " + problem);
    }
  }
  return {};
}

}  // namespace stemvo::options

namespace stemvo {

Status validate(const Options& options) {
  Options copy = options;
  if (Status status = options::check(options::fields_of(copy)); !status) {
    return status;
  }
  if (!(options.stem.contrast_low_percent < options.stem.contrast_high_percent)) {
    return fail(fmt::format(
        "stem.contrast_low_percent: expected less than stem.contrast_high_percent ({}), found {}",
        options.stem.contrast_high_percent, options.stem.contrast_low_percent));
  }
  return {};
}

}  // namespace stemvo
