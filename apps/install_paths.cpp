// SPDX-License-Identifier: MIT
#include "install_paths.hpp"

#include <system_error>

namespace stemvo::apps {

std::filesystem::path data_folder(const char* name) {
  std::error_code code;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", code);
  const std::filesystem::path installed =
      program.parent_path().parent_path() / "share" / "stemvo" / name;
  if (!code && std::filesystem::is_directory(installed, code)) {
    return installed;
  }
  return std::filesystem::path(STEMVO_SOURCE_DIR) / name;
}

}  // namespace stemvo::apps
