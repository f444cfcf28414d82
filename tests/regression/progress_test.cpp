// SPDX-License-Identifier: MIT
// The line of progress in a terminal.
#include <string>

#include <gmock/gmock.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include "support/program_test.hpp"

namespace stemvo {
namespace {

/// All that `stemvo run` writes to a terminal of so many columns.
std::string shown(unsigned short columns) {
  const TempFolder folder;
  const std::string drive = (test::rendered_drive() / "sequences/00").string();
  const std::string out = folder / "out";
  winsize size{};
  size.ws_col = columns;
  size.ws_row = 24;
  int terminal = -1;
  const pid_t child = ::forkpty(&terminal, nullptr, nullptr, &size);
  if (child == 0) {
    ::execl(STEMVO_PROGRAM, STEMVO_PROGRAM, "run", drive.c_str(), "--out", out.c_str(), nullptr);
    ::_exit(127);
  }
  std::string text;
  char buffer[4096];
  for (ssize_t got = 0; (got = ::read(terminal, buffer, sizeof buffer)) > 0;) {
    text.append(buffer, static_cast<std::size_t>(got));
  }
  ::close(terminal);
  int status = -1;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  return text;
}

/// What stands on the terminal's line each time it is written anew.
std::vector<std::string> progress_lines(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t end = text.find("\x1b[K"); end != std::string::npos;
       end = text.find("\x1b[K", end + 1)) {
    const std::size_t begin = text.rfind('\r', end) + 1;
    lines.push_back(text.substr(begin, end - begin));
  }
  return lines;
}

TEST(Progress, FitsTheTerminal) {
  for (const unsigned short columns : {20, 45, 120}) {
    const auto lines = progress_lines(shown(columns));
    ASSERT_FALSE(lines.empty());
    for (const std::string& line : lines) {
      EXPECT_LT(line.size(), columns) << line;
    }
    EXPECT_THAT(lines.back(), HasSubstr("60/60 frames")) << columns;
    EXPECT_THAT(lines.back(), ::testing::ContainsRegex(columns == 20 ? "frames$" : "(/s|in all)$"));
  }
  EXPECT_THAT(progress_lines(shown(120)).back(),
              StartsWith("[==============================] 60/60 frames, "));
}

}  // namespace
}  // namespace stemvo
