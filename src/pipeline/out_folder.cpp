// SPDX-License-Identifier: MIT
#include "pipeline/out_folder.hpp"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include <fmt/format.h>

namespace stemvo::pipeline {

Status create_out_folder(const std::filesystem::path& folder) {
  const auto refuse = [&folder](const std::string& found) {
    return fail(fmt::format("{}: expected an output folder that can be written, found: {}",
                            folder.string(), found));
  };
  std::error_code code;
  std::filesystem::create_directories(folder, code);
  if (code) {
    return refuse(code.message());
  }
  if (!std::filesystem::is_directory(folder, code)) {
    return refuse("a file of that name");
  }
  const std::filesystem::path probe = folder / ".stemvo_probe";
  std::ofstream out(probe);
  if (!(out << "can be written\n") || !out.flush()) {
    return refuse(std::strerror(errno));
  }
  out.close();
  std::filesystem::remove(probe, code);
  return {};
}

}  // namespace stemvo::pipeline
