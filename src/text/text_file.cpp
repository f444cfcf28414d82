// SPDX-License-Identifier: MIT
#include "text/text_file.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

namespace stemvo {
namespace {

namespace fs = std::filesystem;

std::string last_system_error() { return std::generic_category().message(errno); }

/// Nullopt: not a finite number, or not all of the word.
std::optional<double> to_finite(std::string_view word) {
  const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
  double number = 0.0;
  const auto [end, error] = std::from_chars(digits.begin(), digits.end(), number);
  const bool is_good = error == std::errc() && end == digits.end() && std::isfinite(number);
  return is_good ? std::optional(number) : std::nullopt;
}

/// For the reason in errno.
Error cannot_read(const fs::path& file) {
  // What runs out is no fault of the file: it ends the program, as a lack of memory does.
  if (errno == EMFILE || errno == ENFILE || errno == ENOMEM) {
    throw std::system_error(errno, std::generic_category(), file.string() + ": cannot read");
  }
  const char* next = errno == ENOENT ? "; check the path" : "";
  return fail(fmt::format("{}: cannot read: {}{}", file.string(), last_system_error(), next));
}

Expected<std::string> read_opened(int descriptor, const fs::path& file, const SizeLimit& limit) {
  constexpr std::size_t kBytesOfMB = 1000000;
  std::array<char, 1 << 16> buffer;
  ssize_t num_read = ::read(descriptor, buffer.data(), buffer.size());
  if (num_read < 0) {
    return cannot_read(file);
  }
  const auto max_MB = limit({buffer.data(), static_cast<std::size_t>(num_read)});
  if (!max_MB) {
    return max_MB.error();
  }
  const std::size_t max_bytes = static_cast<std::size_t>(*max_MB) * kBytesOfMB;
  std::string text;
  struct stat status = {};
  if (::fstat(descriptor, &status) == 0) {
    const auto size = static_cast<std::size_t>(status.st_size);
    if (size > max_bytes) {
      return fail(fmt::format("{}: expected at most {} MB, found {} MB", file.string(), *max_MB,
                              static_cast<double>(size) / kBytesOfMB));
    }
    text.reserve(size);
  }
  for (; num_read > 0; num_read = ::read(descriptor, buffer.data(), buffer.size())) {
    text.append(buffer.data(), static_cast<std::size_t>(num_read));
    if (text.size() > max_bytes) {  // the size of files of /proc is not told
      return fail(fmt::format("{}: expected at most {} MB, found more", file.string(), *max_MB));
    }
  }
  return num_read == 0 ? Expected<std::string>(std::move(text)) : cannot_read(file);
}

Status refuse_folder(const fs::path& file) {
  std::error_code ignored;
  return fs::is_directory(file, ignored)
             ? Status(
                   fail(fmt::format("{}: expected a file to write, found a folder", file.string())))
             : Status();
}

/// On the disk when it returns. `mode`: how the place is opened. Errors name `file`.
Status write_in_place(const fs::path& file,
                      const fs::path& place,
                      int mode,
                      std::string_view text) {
  const auto failed = [&] {
    return fail(
        fmt::format("{}: cannot write: {}", file.string(),
                    errno == ENXIO ? "found a pipe that nobody reads" : last_system_error()));
  };
  // A pipe that nobody reads is an error; it would wait for ever.
  const int descriptor = ::open(place.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK | mode, 0666);
  if (descriptor < 0 || ::fcntl(descriptor, F_SETFL, 0) != 0) {
    return failed();
  }
  std::FILE* const stream = ::fdopen(descriptor, "wb");
  if (stream == nullptr) {
    return failed();
  }
  const bool is_written =
      std::fwrite(text.data(), 1, text.size(), stream) == text.size() && std::fflush(stream) == 0 &&
      (::fsync(::fileno(stream)) == 0 || errno == EINVAL);  // a pipe has no disk
  const Status status = is_written ? Status() : Status(failed());
  return std::fclose(stream) == 0 || !status ? status : Status(failed());
}

/// In place of what a kill left there; never through a link.
Status write_beside(const fs::path& file, const fs::path& place, std::string_view text) {
  std::error_code ignored;
  fs::remove(place, ignored);
  return write_in_place(file, place, O_CREAT | O_EXCL, text);
}

}  // namespace

std::string_view kind_of(const fs::path& path) {
  std::error_code ignored;
  switch (fs::status(path, ignored).type()) {
    case fs::file_type::regular:
      return "a file";
    case fs::file_type::directory:
      return "a folder";
    case fs::file_type::fifo:
      return "a pipe";
    case fs::file_type::block:
    case fs::file_type::character:
      return "a device";
    case fs::file_type::socket:
      return "a socket";
    default:
      return "nothing of that name";
  }
}

fs::path unfinished(const fs::path& file) { return fs::path(file.string() + ".unfinished"); }

Expected<std::string> read_text_file(const fs::path& file, int max_MB) {
  return read_text_file(file, [max_MB](std::string_view) { return max_MB; });
}

Expected<std::string> read_text_file(const fs::path& file, const SizeLimit& max_MB) {
  std::error_code ignored;
  // Pipes and devices may never end.
  if (fs::exists(file, ignored) && !fs::is_regular_file(file, ignored)) {
    return fail(fmt::format("{}: expected a file, found {}", file.string(), kind_of(file)));
  }
  // Without O_NONBLOCK reading some regular files of /proc waits for ever.
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  const auto text = descriptor < 0 ? Expected<std::string>(cannot_read(file))
                                   : read_opened(descriptor, file, max_MB);
  if (descriptor >= 0) {
    ::close(descriptor);
  }
  return text;
}

Status write_text_file(const fs::path& file, std::string_view text) {
  if (Status status = refuse_folder(file); !status) {
    return status;
  }
  std::error_code code;
  if (fs::exists(file, code) && !fs::is_regular_file(file, code)) {
    return write_in_place(file, file, O_TRUNC, text);  // a pipe or a device cannot be replaced
  }
  const fs::path target = fs::is_symlink(file, code) ? fs::weakly_canonical(file, code) : file;
  Status status = write_beside(file, unfinished(target), text);
  if (status) {
    fs::rename(unfinished(target), target, code);
    if (code) {
      status = fail(fmt::format("{}: cannot write: {}", file.string(), code.message()));
    }
  }
  if (!status) {
    fs::remove(unfinished(target), code);
  }
  return status;
}

Status check_can_write(const fs::path& file) {
  if (Status status = refuse_folder(file); !status) {
    return status;
  }
  std::error_code ignored;
  if (fs::is_fifo(file, ignored) || fs::is_socket(file, ignored)) {  // nobody reads it yet
    return fail(
        fmt::format("{}: expected a file to write, found {}", file.string(), kind_of(file)));
  }
  const Status status = write_beside(file, unfinished(file), "can be written");
  fs::remove(unfinished(file), ignored);
  return status;
}

Status remove_file(const fs::path& file) {
  std::error_code code;
  fs::remove(unfinished(file), code);
  fs::remove(file, code);
  return code ? Status(
                    fail(fmt::format("{}: cannot be removed ({})", file.string(), code.message())))
              : Status();
}

Expected<std::string> read_rows(const fs::path& file, int max_MB) {
  auto text = read_text_file(file, max_MB);
  std::size_t index = 0;
  for (std::size_t begin = 0, end = 0; text && begin < text->size(); begin = end + 1, ++index) {
    end = std::min(text->find('\n', begin), text->size());
    if (index == kMaxLines) {
      return fail(
          fmt::format("{}: expected at most {} lines, found more", file.string(), kMaxLines));
    }
    if (end - begin > kMaxLineBytes) {
      return fail_at(file, index,
                     fail(fmt::format("expected a line of at most {} bytes, found one of {}",
                                      kMaxLineBytes, end - begin)));
    }
  }
  return text;
}

Expected<std::vector<std::string>> read_lines(const fs::path& file, int max_MB) {
  return read_rows(file, max_MB).map([](const std::string& text) {
    const std::vector<std::string_view> lines = split_lines(text);
    return std::vector<std::string>(lines.begin(), lines.end());
  });
}

std::vector<std::string_view> split_lines(std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.ends_with('\r')) {
      line.remove_suffix(1);
    }
    lines.push_back(line);
  }
  return lines;
}

std::string_view take_word(std::string_view& line) {
  const auto is_blank = [](char c) { return c == ' ' || c == '\t'; };
  const auto* const begin = std::find_if_not(line.begin(), line.end(), is_blank);
  const std::string_view word(begin, std::find_if(begin, line.end(), is_blank));
  line = {word.end(), line.end()};
  return word;
}

std::vector<std::string_view> split_words(std::string_view line) {
  std::vector<std::string_view> words;
  for (auto word = take_word(line); !word.empty(); word = take_word(line)) {
    words.push_back(word);
  }
  return words;
}

std::string one_line(std::string_view text) {
  constexpr std::size_t kMaxBytes = 300;
  std::string line(text.substr(0, kMaxBytes));
  std::ranges::replace_if(line, [](unsigned char c) { return c < 0x20; }, ' ');
  return text.size() > kMaxBytes ? line + ".." : line;
}

std::string at_line(const fs::path& file, std::size_t line) {
  return fmt::format("{}:{}", file.string(), line);
}

Error fail_at(const fs::path& file, std::size_t index, const Error& error) {
  return fail(fmt::format("{}: {}", at_line(file, index + 1), error.message));
}

std::optional<std::size_t> parse_index(std::string_view text) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(text.begin(), text.end(), index);
  return error == std::errc() && end == text.end() ? std::optional(index) : std::nullopt;
}

Expected<std::vector<double>> parse_numbers(std::string_view line, std::size_t count) {
  constexpr double kLargest = 1e20;  // squares and sums stay finite
  std::vector<double> numbers;
  std::size_t num_found = 0;
  for (auto word = take_word(line); !word.empty(); word = take_word(line)) {
    const std::optional<double> number = to_finite(word);
    if (!number) {
      return fail(fmt::format("expected a finite number, found '{}'",
                              word.substr(0, 40)));  // a binary file has long words
    }
    if (!(std::abs(*number) <= kLargest)) {
      return fail(fmt::format("expected a number of size up to {}, found {}", kLargest, *number));
    }
    if (++num_found <= count) {  // a line of a hostile file may have millions
      numbers.push_back(*number);
    }
  }
  if (num_found != count) {
    return fail(
        fmt::format("expected {} number{}, found {}", count, count == 1 ? "" : "s", num_found));
  }
  return numbers;
}

}  // namespace stemvo
