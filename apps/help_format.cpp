// SPDX-License-Identifier: MIT
#include "help_format.hpp"

#include <algorithm>
#include <sstream>

namespace stemvo::apps {
namespace {

constexpr std::size_t kWidth = 80;

/// Broken at blanks; what does not fit goes on at the column `hang`.
std::string wrap(std::string text, std::size_t hang) {
  std::size_t start = 0;
  while (text.size() - start > kWidth) {
    const std::size_t first = text.find_first_not_of(' ', start);
    std::size_t end = text.rfind(' ', start + kWidth);
    end = end == std::string::npos || end < first ? text.find(' ', first) : end;
    if (end == std::string::npos) {
      break;
    }
    const std::size_t last = text.find_last_not_of(' ', end) + 1;
    text.replace(last, text.find_first_not_of(' ', end) - last, '\n' + std::string(hang, ' '));
    start = last + 1;
  }
  return text + '\n';
}

/// An indented line: a name and, behind two blanks, what it is.
std::string wrap_entry(const std::string& line) {
  const std::size_t indent = std::min(line.find_first_not_of(' '), line.size());
  const std::size_t gap = line.rfind("  ");
  const std::size_t column = gap == std::string::npos || gap < indent ? indent : gap + 2;
  if (line.size() <= kWidth || line.find("stemvo ") == indent) {
    return line + '\n';
  }
  return wrap(line, column < kWidth / 2 ? column : indent + 4);
}

}  // namespace

std::string HelpFormat::make_option(const CLI::Option* option, bool is_positional) const {
  std::istringstream lines(Formatter::make_option(option, is_positional));
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    text += wrap_entry(line);
  }
  return text;
}

std::string HelpFormat::make_footer(const CLI::App* app) const {
  std::istringstream lines(Formatter::make_footer(app));
  std::string footer;
  std::string paragraph;
  const auto end_paragraph = [&] {
    footer += paragraph.empty() ? "" : wrap(paragraph, 0);
    paragraph.clear();
  };
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.front() == ' ') {
      end_paragraph();
      footer += wrap_entry(line);
    } else {
      paragraph += (paragraph.empty() ? "" : " ") + line;
    }
  }
  end_paragraph();
  return footer;
}

}  // namespace stemvo::apps
