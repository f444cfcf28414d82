// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string_view>

#include <Eigen/Core>

namespace stemvo {

/// A landmark of the map, which knows nothing of a road.
struct RoadLandmark {
  Eigen::Vector3d in_camera;  ///< in units of the map
  double sigma = 0.0;         ///< of its inverse depth, as a share of it
};

/// One frame for and against a road at the camera's height.
struct RoadEvidence {
  /// Landmarks seen through the strip of road: on the plane that was measured (or predicted),
  /// behind it, in front of it.
  int num_on = 0;
  int num_below = 0;
  int num_above = 0;
  bool is_in_sight = false;     ///< the strip is in the image
  double measured_share = 0.0;  ///< estimators that measured, of those asked
  /// log_scale against the filter's prediction, standard deviations.
  std::optional<double> innovation;
  std::optional<double> correlation;  ///< of the images, more than without the plane
  double profile_chi2 = 0.0;  ///< slope and bend against the way driven; 2 degrees of freedom
  double roll_chi2 = 0.0;     ///< against a camera that stands upright
  double travelled = 1.0;     ///< since the frame before, heights of the camera
};

/// Weighs whether the plane that is measured is the road under the camera: log-odds, the sum of
/// what frames say, within bounds. A wall or a table may fit one frame as well as a road does, but
/// landmarks lie behind it or before it, it tilts against the way driven, and the scale from it
/// jumps. Frames on which nothing is measured never take a belief away: the map holds the scale.
class RoadBelief {
 public:
  void add(const RoadEvidence& evidence);
  /// Another map: its scale must be proven once more, but not the camera's mount.
  void restart();

  [[nodiscard]] bool is_believed() const { return is_believed_; }
  /// So many times the filter's sigma is the error of the scale: the filter takes the errors of
  /// neighbouring frames for independent, and their size for the given one. Both show in the mean
  /// of innovations over as many frames as the filter joins.
  [[nodiscard]] double sigma_factor() const;
  /// The strongest reason against the road when there last was one.
  [[nodiscard]] std::string_view doubt() const { return doubt_; }

 private:
  double log_odds_ = kStart;
  bool is_believed_ = false;
  double mean_innovation_ = 0.0;  ///< of the last ones
  double lasting2_ = 2.0;         ///< its mean square, as a multiple of independent errors'
  int num_innovations_ = 5;       ///< the first guess counts as much
  std::string_view doubt_ = kUnproven;

  static constexpr double kStart = -1.0;
  static constexpr std::string_view kUnproven = "no road is proven yet";
};

}  // namespace stemvo
