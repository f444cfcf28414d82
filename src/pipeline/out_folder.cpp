// SPDX-License-Identifier: MIT
#include "pipeline/out_folder.hpp"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

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

Status remove_old_frames(const std::filesystem::path& folder, const std::string& extension) {
  std::error_code code;
  std::vector<std::filesystem::path> old;
  std::filesystem::directory_iterator entry(folder, code);
  for (; !code && entry != std::filesystem::directory_iterator(); entry.increment(code)) {
    const std::string stem = entry->path().stem().string();
    const bool is_number = stem.size() == 6 && stem.find_first_not_of("0123456789") == stem.npos;
    std::error_code ignored;
    if (is_number && entry->path().extension() == extension && entry->is_regular_file(ignored)) {
      old.push_back(entry->path());
    }
  }
  for (const std::filesystem::path& file : old) {
    if (!code && !std::filesystem::remove(file, code) && code) {
      return fail(fmt::format("{}: an earlier run's frame cannot be removed ({})", file.string(),
                              code.message()));
    }
  }
  return {};
}

}  // namespace stemvo::pipeline
