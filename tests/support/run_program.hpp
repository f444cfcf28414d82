// SPDX-License-Identifier: MIT
#pragma once

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "support/test.hpp"

namespace stemvo::test {

/// The whole file; empty where there is none.
inline std::string read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

using Words = std::vector<std::string>;

inline Words joined(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

struct ProgramResult {
  int exit_code = -1;  ///< 128 + signal when the program was killed
  double cpu_s = 0.0;  ///< of all its threads; unlike the clock's it hardly knows of other programs
  double peak_mib = 0.0;  ///< most memory it held at once
  std::string out;
  std::string err;
};

/// A program as a child process, its output caught in files.
class RunningProgram {
 public:
  RunningProgram(const std::string& program, const Words& arguments) {
    std::vector<char*> argv = {const_cast<char*>(program.c_str())};
    for (const std::string& argument : arguments) {
      argv.push_back(const_cast<char*>(argument.c_str()));
    }
    argv.push_back(nullptr);
    pid_ = ::fork();
    if (pid_ == 0) {
      redirect("/dev/null", STDIN_FILENO, O_RDONLY);
      redirect(out_, STDOUT_FILENO, O_WRONLY | O_CREAT | O_TRUNC);
      redirect(err_, STDERR_FILENO, O_WRONLY | O_CREAT | O_TRUNC);
      ::execv(program.c_str(), argv.data());
      ::_exit(127);
    }
  }

  void send(int signal) const { ::kill(pid_, signal); }

  ProgramResult wait() {
    int status = 0;
    struct rusage usage = {};
    ::wait4(pid_, &status, 0, &usage);
    ProgramResult result;
    result.cpu_s = seconds(usage.ru_utime) + seconds(usage.ru_stime);
    result.peak_mib = static_cast<double>(usage.ru_maxrss) / 1024.0;
    result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    result.out = read_file(out_);
    result.err = read_file(err_);
    return result;
  }

 private:
  static double seconds(const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  }
  static void redirect(const std::filesystem::path& file, int descriptor, int flags) {
    const int opened = ::open(file.c_str(), flags, 0600);
    ::dup2(opened, descriptor);
    ::close(opened);
  }

  testing::TempFolder folder_;
  const std::filesystem::path out_ = folder_ / "out";
  const std::filesystem::path err_ = folder_ / "err";
  pid_t pid_ = -1;
};

inline ProgramResult run_program(const std::string& program, const Words& arguments) {
  return RunningProgram(program, arguments).wait();
}

/// The stemvo program that this build made.
inline ProgramResult run_stemvo(const Words& arguments, const Words& more = {}) {
  return run_program(STEMVO_PROGRAM, joined(arguments, more));
}

/// The result of a program that had to end with 0; throws what it said where it did not.
inline ProgramResult succeeded(ProgramResult result) {
  if (result.exit_code != 0) {
    throw std::runtime_error(fmt::format("exit code {}: {}", result.exit_code, result.err));
  }
  return result;
}

/// Motion JPEG of images of one size.
inline void write_video(const std::string& file,
                        double rate_hz,
                        const std::vector<std::filesystem::path>& images) {
  succeeded(run_program(STEMVO_WRITE_VIDEO, joined({file, fmt::format("{}", rate_hz)},
                                                   Words(images.begin(), images.end()))));
}

}  // namespace stemvo::test
