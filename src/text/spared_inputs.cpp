// SPDX-License-Identifier: MIT
#include "text/spared_inputs.hpp"

#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <sys/stat.h>

#include "text/text_file.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

using Identity = std::pair<dev_t, ino_t>;

/// Of what a path leads to.
std::optional<Identity> identity(const fs::path& path) {
  struct stat found = {};
  return ::stat(path.c_str(), &found) == 0 ? std::optional(Identity(found.st_dev, found.st_ino))
                                           : std::nullopt;
}

}  // namespace

Status check_spares_inputs(const std::vector<fs::path>& outputs,
                           const std::vector<fs::path>& inputs) {
  std::map<Identity, fs::path> written;
  for (const fs::path& file : outputs) {
    for (const fs::path& place : {file, unfinished(file)}) {
      if (const auto found = identity(place)) {
        written.emplace(*found, place);
      }
    }
  }
  for (const fs::path& input : inputs) {
    const auto found = written.empty() ? std::nullopt : identity(input);
    if (const auto output = found ? written.find(*found) : written.end(); output != written.end()) {
      return fail(fmt::format("{}: expected a file to write that is no input, found {}",
                              output->second.string(), input.string()));
    }
  }
  return {};
}

}  // namespace stemvo
