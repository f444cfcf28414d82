// SPDX-License-Identifier: MIT
#include "help_format.hpp"

#include <algorithm>
#include <sstream>
#include <utility>

namespace stemvo::apps {
namespace {

constexpr std::size_t kWidth = 80;

/// Broken at blanks. The rest goes on below the text: behind the name of an option, if there is
/// one, and the two blanks that follow it.
std::string wrap(std::string line) {
  const std::size_t indent = std::min(line.find_first_not_of(' '), line.size());
  const std::size_t gap = line.rfind("  ");
  const bool is_entry = gap != std::string::npos && gap > indent && gap < kWidth / 2;
  const std::string hang(is_entry ? gap + 2 : indent, ' ');
  std::string text;
  while (line.size() > kWidth && line.find("stemvo ") != indent) {
    const std::size_t end = line.rfind(' ', kWidth);
    if (end == std::string::npos || end <= hang.size()) {
      break;
    }
    text += line.substr(0, line.find_last_not_of(' ', end) + 1) + '\n';
    line.replace(0, end + 1, hang);
  }
  return text + line + '\n';
}

}  // namespace

std::string HelpFormat::make_help(const CLI::App* app,
                                  std::string name,
                                  CLI::AppFormatMode mode) const {
  std::istringstream lines(Formatter::make_help(app, std::move(name), mode));
  std::string help;
  for (std::string line; std::getline(lines, line);) {
    help += wrap(line);
  }
  return help;
}

}  // namespace stemvo::apps
