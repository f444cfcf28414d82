// SPDX-License-Identifier: MIT
#pragma once

namespace stemvo {

/// Most memory this program has held at once (VmHWM of /proc/self/status: unlike getrusage, not
/// that of the program that started it); NaN where the system does not tell.
[[nodiscard]] double peak_memory_mib();

}  // namespace stemvo
