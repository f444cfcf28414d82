// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <string>

#include "stemvo/error.hpp"

namespace stemvo {

/// Size of the image that points are tracked on. kAuto: for patches and KLT kHalf where the focal
/// length is 500 px or more, else kInputZoomed; for descriptors kInput.
enum class TrackingResolution {
  kAuto,
  kInput,        ///< the input's
  kInputZoomed,  ///< the input's; where the sampling is even, the frame is enlarged in place of the
                 ///< channel, so that a filter sees the angle it was learned for
  kHalf,         ///< half the input's; the channel's where its sampling is odd and above 1
  kNative,       ///< the channel's
};

/// Keys `stem.*`: the filter channel a frame is seen through.
struct StemOptions {
  /// `default` or `paper`, which are built in; the path of an .onnx file that says its kernel,
  /// stride and padding in its metadata (`stemvo-lab export` writes them); or one made by hand, to
  /// compare with: `gray`, `input_layer` (filters 0, 1, 2 = R, G, B), `log` (Laplacian of
  /// Gaussian), `census` (gray levels against their surroundings').
  std::string model = "default";
  int filter = -1;      ///< -1: the model's default_filter (gray, input_layer: 0)
  int sampling_px = 0;  ///< input pixels per channel pixel, a divisor of the stride; 0: 2, or 1
  TrackingResolution tracking_resolution = TrackingResolution::kAuto;
  double contrast_low_percent = 0.5;  ///< percentiles mapped to 0 and 255
  double contrast_high_percent = 99.5;
  double contrast_memory = 0.95;  ///< share of the last limits kept at each frame
};

enum class FeatureMethod {
  kPatch,  ///< corners, tracked by aligning the patch of their first frame
  kKlt,    ///< corners, tracked by pyramidal Lucas-Kanade from frame to frame
  kOrb,    ///< described and matched (the paper's)
  kSift,   ///< described and matched
};

/// Keys `features.*`.
struct FeatureOptions {
  FeatureMethod method = FeatureMethod::kPatch;
  int max_features = 500;  ///< keypoints aimed at per frame
  int grid_columns = 16;   ///< quota per cell = max_features / (columns * rows)
  int grid_rows = 6;
  double corner_quality = 0.005;          ///< patch, klt: least corner response over the strongest
  double min_distance_px = 8.0;           ///< patch, klt: between keypoints, in input pixels
  int klt_window = 11;                    ///< klt: input pixels, odd; at least 7 of the image
  int klt_levels = 4;                     ///< patch, klt: of the pyramid over the input's size
  double max_forward_backward_px = 0.25;  ///< klt: input pixels
  int fast_threshold = 10;                ///< orb
  double ratio = 0.8;                     ///< sift: best over second-best descriptor distance
};

enum class RobustEstimator { kMagsac, kRansac };

/// Keys `two_view.*`: motion from two views, while initializing and in mode two_frame.
struct TwoViewOptions {
  double sigma_px = 1.0;           ///< of eq. (5)-(6), in input pixels
  double homography_ratio = 0.40;  ///< R_H above it: homography (while initializing)
  RobustEstimator estimator = RobustEstimator::kMagsac;
  double inlier_threshold_px = 0.5;  ///< of the robust estimators
  double confidence = 0.9999;
  int max_iterations = 1000;
  bool refine = true;  ///< nonlinear refinement of R, t on the inliers
  double refine_loss_px = 0.3;
};

enum class OdometryMode {
  kTwoFrame,  ///< motions of pairs of frames are chained (the paper's)
  kMap,       ///< frames are localized against landmarks of a window of keyframes
};
enum class Composition {
  kRight,  ///< R_c R
  kPaper,  ///< R R_c, as printed in eq. (12)
};
/// A step of mode two_frame that does not go forward loses this.
enum class ForwardGate { kPaper /* translation and rotation */, kOff };

/// Keys `odometry.*`.
struct OdometryOptions {
  OdometryMode mode = OdometryMode::kMap;
  Composition composition = Composition::kRight;
  ForwardGate gate = ForwardGate::kOff;
  int min_inliers = 20;              ///< fewer: the frame is lost
  double stationary_flow_px = 0.15;  ///< median flow below it: stationary
  double min_parallax_px = 0.6;      ///< median rotation-free flow below it: low parallax
  bool loops = true;  ///< map: places are remembered and recognized, after a loss too
};

/// Keys `window.*`: the keyframes that frames are localized against (mode map).
struct KeyframeWindowOptions {
  int num_keyframes = 8;
};

/// Keys `ba.*`: bundle adjustment of the window (mode map).
struct BaOptions {
  int every_n_keyframes = 1;  ///< the paper's m; 0: never
  int max_iterations = 10;
  double loss_px = 0.2;  ///< Cauchy scale on the reprojection error
};

/// Parameters of the given camera that are refined while driving (mode map): they are changed only
/// where the data are significant (> 2 sigma).
enum class CameraRefinement { kOff, kPrincipalPoint, kAll /* the focal length too */ };

/// Keys `camera.*`.
struct CameraOptions {
  CameraRefinement refine = CameraRefinement::kPrincipalPoint;
};

enum class ScaleSource {
  kNone,           ///< up to scale: units, not metres
  kConstantSpeed,  ///< steps of the same length
  kCameraHeight,   ///< from the road, whose distance below the camera is known
};
enum class RoadEstimators { kBoth, kDense /* aligned image */, kPoints /* tracked corners */ };

/// Keys `scale.*`.
struct ScaleOptions {
  ScaleSource source = ScaleSource::kNone;
  double step_m = 1.0;            ///< per frame
  double camera_height_m = 1.65;  ///< above the road
  RoadEstimators estimators = RoadEstimators::kBoth;
};

/// Everything that steers the odometry. Defaults stand here, once.
struct Options {
  /// Options of a camera on a vehicle, `height_m` above its road: metres.
  [[nodiscard]] static Options driving(double height_m);

  StemOptions stem;
  FeatureOptions features;
  TwoViewOptions two_view;
  OdometryOptions odometry;
  KeyframeWindowOptions window;
  BaOptions ba;
  CameraOptions camera;
  ScaleOptions scale;
  std::uint64_t seed = 1;  ///< of every random number
  int threads = 0;         ///< at work at a time; 0: one per core
};

/// Ranges of all members; infinite, NaN and undefined enumerators fail. The error names the key as
/// in config/default.yaml, e.g. "stem.filter: expected ..., found ...".
[[nodiscard]] Status validate(const Options& options);

}  // namespace stemvo
