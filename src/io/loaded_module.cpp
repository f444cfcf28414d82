// SPDX-License-Identifier: MIT
#include "io/loaded_module.hpp"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include <dlfcn.h>
#include <fmt/format.h>

namespace stemvo::io {
namespace fs = std::filesystem;

Expected<void*> load_symbol(const std::string& module, const char* symbol, std::string_view what) {
  std::error_code code;
  const fs::path program = fs::read_symlink("/proc/self/exe", code);
  const fs::path installed = program.parent_path() / STEMVO_RUNTIME_FROM_BIN / module;
  std::string why;
  // An installed program loads nothing from where it was built: that may be anybody's by now.
  const fs::path tree = fs::weakly_canonical(STEMVO_BUILT_MODULES, code);
  const bool is_built = std::ranges::mismatch(tree, program).in1 == tree.end();
  for (const fs::path& place : {installed, tree / module}) {
    if (place != installed && !is_built) {
      break;
    }
    void* const loaded = ::dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (void* const found = loaded != nullptr ? ::dlsym(loaded, symbol) : nullptr) {
      return found;
    }
    why += fmt::format("; {}", ::dlerror());
  }
  return fail(
      fmt::format("{}: expected the module that {} beside the program, found none that loads{}",
                  installed.lexically_normal().string(), what, why));
}

}  // namespace stemvo::io
