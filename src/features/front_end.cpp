// SPDX-License-Identifier: MIT
#include "stemvo/features/front_end.hpp"

#include "features/descriptor_front_end.hpp"
#include "features/klt_front_end.hpp"

namespace stemvo {

Expected<std::unique_ptr<FrontEnd>> create_front_end(const FeatureOptions& options) {
  if (options.method == "klt") {
    return std::make_unique<KltFrontEnd>(options);
  }
  if (options.method == "orb") {
    return std::make_unique<DescriptorFrontEnd>(DescriptorFrontEnd::Kind::kOrb, options);
  }
  if (options.method == "sift") {
    return std::make_unique<DescriptorFrontEnd>(DescriptorFrontEnd::Kind::kSift, options);
  }
  return fail("features.method: expected klt, orb or sift, found '" + options.method + "'");
}

}  // namespace stemvo
