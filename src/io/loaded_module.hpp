// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

#include "stemvo/error.hpp"

namespace stemvo::io {

/// A symbol of a module of the program ("libstemvo_video.so"), loaded now and never unloaded: from
/// where the program is installed, else from where it was built. Error: the module, which does
/// `what`, is in neither place or does not load.
[[nodiscard]] Expected<void*> load_symbol(const std::string& module,
                                          const char* symbol,
                                          std::string_view what);

}  // namespace stemvo::io
