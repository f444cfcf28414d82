// SPDX-License-Identifier: MIT
#pragma once

#include <exception>
#include <string>

namespace stemvo::apps {

/// The C library loads what unwinds the stack at its first use, which may be where memory has run
/// out (backtrace(3), notes): from here on it is there.
void prepare_exceptions();

/// What an exception that nobody caught means: what ran out (memory, threads, open files), else
/// "internal: ..", a bug of ours.
[[nodiscard]] std::string describe(const std::exception_ptr& error);

}  // namespace stemvo::apps
