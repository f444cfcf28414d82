// SPDX-License-Identifier: MIT
#pragma once

#include <tbb/parallel_invoke.h>

#include "threads/hand_over.hpp"

namespace stemvo {

/// Runs both and waits for both, in two threads where two are free. What one throws leaves this
/// function, after both ended.
template <typename First, typename Second>
void run_side_by_side(const First& first, const Second& second) {
  HandOver start;
  HandOver end;
  start.give();
  tbb::parallel_invoke(HandedOver(start, end, first), HandedOver(start, end, second));
  end.take();
}

}  // namespace stemvo
