// SPDX-License-Identifier: MIT
#pragma once

namespace stemvo::apps {

/// From here on the first SIGINT or SIGTERM asks the program to stop and write what it has; the
/// second ends it at once.
void catch_interrupts();

/// True once an interrupt came.
[[nodiscard]] bool is_interrupted();

}  // namespace stemvo::apps
