// SPDX-License-Identifier: MIT
#pragma once

#include <exception>
#include <string>

namespace stemvo::apps {

/// What an exception that nobody caught means: what ran out (memory, threads, open files), else
/// "internal: ..", a bug of ours.
[[nodiscard]] std::string describe(const std::exception_ptr& error);

}  // namespace stemvo::apps
