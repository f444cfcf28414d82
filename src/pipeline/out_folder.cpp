// SPDX-License-Identifier: MIT
#include "pipeline/out_folder.hpp"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"

namespace stemvo::pipeline {

namespace fs = std::filesystem;

Status create_out_folder(const fs::path& folder) {
  const auto refuse = [&folder](const std::string& found) {
    return fail(fmt::format("{}: expected an output folder that can be written, found: {}",
                            folder.string(), found));
  };
  std::error_code code;
  fs::create_directories(folder, code);
  if (code) {
    return refuse(code.message());
  }
  if (!fs::is_directory(folder, code)) {
    return refuse("a file of that name");
  }
  const fs::path probe = folder / ".stemvo_probe";
  std::ofstream out(probe);
  const bool is_written = (out << "can be written\n") && out.flush();
  const int error = errno;
  out.close();
  fs::remove(probe, code);
  return is_written ? Status() : Status(refuse(std::strerror(error)));
}

Status remove_old_frames(const fs::path& folder, const std::string& extension) {
  for (const fs::path& file : dataset::list_folder(folder).value_or(std::vector<fs::path>())) {
    const std::string stem = file.stem().string();
    const bool is_number = stem.size() == 6 && stem.find_first_not_of("0123456789") == stem.npos;
    std::error_code code;
    if (is_number && file.extension() == extension && fs::is_regular_file(file, code) &&
        !fs::remove(file, code) && code) {
      return fail(fmt::format("{}: an earlier run's frame cannot be removed ({})", file.string(),
                              code.message()));
    }
  }
  return {};
}

}  // namespace stemvo::pipeline
