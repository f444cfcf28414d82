// SPDX-License-Identifier: MIT
#include "timing/peak_memory.hpp"

#include <fstream>
#include <limits>
#include <string>

namespace stemvo {

double peak_memory_mib() {
  std::ifstream status("/proc/self/status");
  for (std::string key; status >> key;) {
    double kib = 0.0;
    if (key == "VmHWM:" && status >> kib) {
      return kib / 1024.0;
    }
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace stemvo
