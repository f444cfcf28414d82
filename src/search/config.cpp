// SPDX-License-Identifier: MIT
#include "stemvo/search/search.hpp"

namespace stemvo {

Config search_defaults() {
  Config config;
  config.odometry.mode = "two_frame";
  config.scale.source = "ground_truth";
  config.features.max_features = 400;
  config.features.klt_window = 23;
  // The refinement behind it forgets which estimator brought the first guess.
  config.two_view.estimator = "ransac";
  config.two_view.max_iterations = 200;
  config.two_view.confidence = 0.99;
  return config;
}

}  // namespace stemvo
