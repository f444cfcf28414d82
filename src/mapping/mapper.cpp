// SPDX-License-Identifier: MIT
#include "mapping/mapper.hpp"

namespace stemvo {

void Mapper::observe(const WindowView& view) {
  if (is_on_) {
    keeper_.add_nodes(view);
  }
}

void Mapper::leave(const WindowView& view, std::size_t leaving) {
  if (is_on_) {
    keeper_.leave(view, leaving);
  }
}

void Mapper::close(const WindowView& view) {
  if (is_on_) {
    keeper_.close(view);
  }
}

KeptMap Mapper::map(const WindowView& view) const {
  MapKeeper keeper = keeper_;
  if (is_on_) {
    keeper.close(view);
  }
  return keeper.map();
}

}  // namespace stemvo
