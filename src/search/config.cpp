// SPDX-License-Identifier: MIT
#include "stemvo/search/search.hpp"

namespace stemvo {

Config search_defaults() {
  Config config;
  config.odometry.mode = "two_frame";
  config.scale.source = "ground_truth";
  config.stem.upsample = "native";
  config.features.max_features = 400;
  config.features.klt_levels = 3;
  return config;
}

}  // namespace stemvo
