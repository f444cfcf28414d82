// SPDX-License-Identifier: MIT
#include "features/front_end.hpp"

#include "features/descriptor_front_end.hpp"
#include "features/klt_front_end.hpp"
#include "features/patch_front_end.hpp"

namespace stemvo {

std::unique_ptr<FrontEnd> create_front_end(const FeatureOptions& options) {
  if (options.method == FeatureMethod::kPatch) {
    return std::make_unique<PatchFrontEnd>(options);
  }
  if (options.method == FeatureMethod::kKlt) {
    return std::make_unique<KltFrontEnd>(options);
  }
  return std::make_unique<DescriptorFrontEnd>(options);
}

}  // namespace stemvo
