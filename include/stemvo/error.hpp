// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <utility>

#include <tl/expected.hpp>

namespace stemvo {

/// The world disagrees: a file, a model, a key. The message is one line that names the file
/// (and line where there is one), what was expected and what was found.
struct Error {
  std::string message;
};

/// A value, or the Error that kept us from it.
template <typename T>
using Expected = tl::expected<T, Error>;

/// Success, or an Error.
using Status = Expected<void>;

/// Builds the error side of any Expected: `return fail("calib.txt:3: expected ...")`.
[[nodiscard]] inline tl::unexpected<Error> fail(std::string message) {
  return tl::unexpected<Error>(Error{std::move(message)});
}

}  // namespace stemvo
