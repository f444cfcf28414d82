// SPDX-License-Identifier: MIT
#pragma once

namespace stemvo::apps {

/// From here on the first SIGINT, SIGTERM or SIGHUP asks the program to stop and write what it has;
/// the second ends it at once. A division in a model that the processor refuses ends it with one
/// line.
void catch_interrupts();

/// True once an interrupt came.
[[nodiscard]] bool is_interrupted();

}  // namespace stemvo::apps
