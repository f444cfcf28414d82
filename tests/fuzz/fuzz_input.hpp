// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <sys/mman.h>
#include <unistd.h>

namespace stemvo::fuzz {

/// The fuzzer's bytes as a file in memory, which goes with the process whatever ends it.
class InputFile {
 public:
  InputFile(const std::uint8_t* data, std::size_t size) : number_(::memfd_create("input", 0)) {
    if (number_ < 0 || ::write(number_, data, size) != static_cast<ssize_t>(size)) {
      std::abort();
    }
  }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  ~InputFile() { ::close(number_); }

  [[nodiscard]] std::filesystem::path path() const {
    return "/proc/self/fd/" + std::to_string(number_);
  }

 private:
  int number_;
};

/// A promise that a reader makes of the values it gives: a find where it is broken.
inline void expect(bool holds, const char* promise) {
  if (!holds) {
    std::fprintf(stderr, "broken promise: %s\n", promise);
    std::abort();
  }
}

/// Each error says something.
template <typename Result>
void expect_said(const Result& result) {
  expect(result.has_value() || !result.error().message.empty(), "an error has a message");
}

}  // namespace stemvo::fuzz

/// libFuzzer calls it with each input.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
