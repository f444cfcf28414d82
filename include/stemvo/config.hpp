// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stemvo/error.hpp"
#include "stemvo/evaluation/metrics.hpp"
#include "stemvo/features/front_end.hpp"
#include "stemvo/stem/stem.hpp"

namespace stemvo {

/// Keys `input.*`.
struct InputOptions {
  std::string camera = "auto";
};

/// Keys `two_view.*`.
struct TwoViewOptions {
  double sigma_px = 1.0;             ///< of eq. (5)-(6), in input pixels
  double homography_ratio = 0.40;    ///< R_H above it: homography (while initialising)
  std::string estimator = "magsac";  ///< `magsac` or `ransac`, of OpenCV
  double inlier_threshold_px = 0.5;  ///< of the robust estimators
  double confidence = 0.9999;
  int max_iterations = 1000;
  bool refine = true;  ///< nonlinear refinement of R, t on the inliers
  double refine_loss_px = 0.3;
};

/// Keys `odometry.*`.
struct OdometryOptions {
  std::string mode = "map";           ///< `two_frame` chains pairs; `map` adds a local map
  std::string composition = "right";  ///< `right`: R_c R; `paper`: R R_c
  std::string gate = "off";  ///< two_frame: `translation`, `paper` (drops the rotation too), `off`
  int min_inliers = 20;      ///< fewer: the frame is lost
  double stationary_flow_px = 0.15;  ///< median flow below it: stationary
  double min_parallax_px = 0.6;      ///< median rotation-free flow below it: low parallax
};

/// Keys `refine.*`: bundle adjustment of the local map (odometry.mode: map).
struct RefineOptions {
  int every = 1;   ///< keyframes between refinements, the paper's m; 0: never
  int window = 8;  ///< keyframes refined together
  int max_iterations = 10;
  double loss_px = 0.2;  ///< Cauchy scale on the reprojection error
};

/// Keys `scale.*`.
struct ScaleOptions {
  /// `none` (up to scale), `constant`, `camera_height` or `ground_truth`
  std::string source = "camera_height";
  double constant_m = 1.0;          ///< per frame
  double camera_height_m = 1.65;    ///< above the road, for `camera_height`
  std::string estimators = "both";  ///< of the road: `both`, `dense` or `points`
  bool joining = true;              ///< of the road's measurements over time
};

/// The whole configuration. Defaults stand here, once; config/default.yaml is generated from them.
struct Config {
  InputOptions input;
  StemOptions stem;
  FeatureOptions features;
  TwoViewOptions two_view;
  OdometryOptions odometry;
  RefineOptions refine;
  ScaleOptions scale;
  EvaluationOptions evaluation;
  std::uint64_t seed = 1;
};

/// Reads a YAML file over `base`. Errors with file and line: not YAML, unknown or duplicated key,
/// wrong type, value out of range.
[[nodiscard]] Expected<Config> load_config(const std::filesystem::path& file,
                                           const Config& base = {});
/// The keys a YAML file sets, e.g. "scale.source". Errors: it cannot be read, it is not YAML.
[[nodiscard]] Expected<std::vector<std::string>> keys_in_config(const std::filesystem::path& file);
/// `key=value` of --set, e.g. "stem.filter=10".
[[nodiscard]] Status apply_override(Config& config, const std::string& assignment);
/// Ranges and choices of every key; written so that NaN fails.
[[nodiscard]] Status validate(const Config& config);
/// With what stem.upsample: auto stands for, for frames of this width: `half` for KLT on 1000
/// columns and more, else `bicubic`. KLT finds subpixel places on a channel of every second pixel
/// as it is, but not on a coarser one (of 16 random filters of stride 16 none is tracked). orb and
/// sift lose their keypoints on a smaller picture, and small frames the texture of the road.
[[nodiscard]] Config with_chosen_upsample(Config config, int width_px);
/// YAML with every key, exact (numbers round-trip).
[[nodiscard]] std::string dump_config(const Config& config);

}  // namespace stemvo
