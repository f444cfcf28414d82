// SPDX-License-Identifier: MIT
#include "search/record_file.hpp"

#include <cerrno>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include "search/record_json.hpp"
#include "text/text_file.hpp"

namespace stemvo::search {
namespace {

/// Until the descriptor is closed, or the process is gone.
Status lock(int descriptor, const std::filesystem::path& file) {
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    return fail(fmt::format("{}: another search is writing it", file.string()));
  }
  return {};
}

}  // namespace

struct RecordWriter::Descriptor {
  explicit Descriptor(int number_in) : number(number_in) {}
  ~Descriptor() {
    if (number >= 0) {
      ::close(number);
    }
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number;
};

Expected<RecordFileContent> read_records(const std::filesystem::path& file) {
  const Expected<std::string> text = read_text_file(file);
  if (!text) {
    return text.error();
  }
  RecordFileContent content;
  std::size_t line_number = 0;
  for (std::size_t begin = 0; begin < text->size();) {
    const std::size_t end = text->find('\n', begin);
    if (end == std::string::npos) {
      break;  // torn by a kill
    }
    const std::string line = text->substr(begin, end - begin);
    ++line_number;
    Status status;
    if (line_number == 1) {
      status = parse_identity(line, content.identity);
    } else {
      content.records.emplace_back();
      status = parse_record(line, content.records.back());
    }
    if (!status) {
      return fail(fmt::format("{}: {}", at_line(file, line_number), status.error().message));
    }
    begin = end + 1;
    content.num_good_bytes = begin;
  }
  return content;
}

RecordWriter::RecordWriter(std::filesystem::path file, std::shared_ptr<const Descriptor> descriptor)
    : file_(std::move(file)), descriptor_(std::move(descriptor)) {}

Expected<RecordWriter> RecordWriter::create(const std::filesystem::path& file,
                                            const SearchIdentity& identity) {
  auto descriptor = std::make_shared<const Descriptor>(
      ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644));
  if (descriptor->number < 0) {
    return fail(fmt::format("{}: cannot be created: {}", file.string(), std::strerror(errno)));
  }
  if (const Status locked = lock(descriptor->number, file); !locked) {
    return locked.error();
  }
  RecordWriter writer(file, std::move(descriptor));
  if (const Status status = writer.write(identity_line(identity) + '\n'); !status) {
    return status.error();
  }
  return writer;
}

Expected<RecordWriter> RecordWriter::go_on(const std::filesystem::path& file,
                                           std::uintmax_t num_good_bytes) {
  auto descriptor = std::make_shared<const Descriptor>(::open(file.c_str(), O_WRONLY | O_CLOEXEC));
  const auto size = static_cast<off_t>(num_good_bytes);
  if (descriptor->number >= 0) {
    if (const Status locked = lock(descriptor->number, file); !locked) {
      return locked.error();
    }
  }
  if (descriptor->number < 0 || ::ftruncate(descriptor->number, size) != 0 ||
      ::lseek(descriptor->number, 0, SEEK_END) < 0) {
    return fail(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(errno)));
  }
  return RecordWriter(file, std::move(descriptor));
}

Status RecordWriter::append(std::span<const Record> records) {
  std::string text;
  for (const Record& record : records) {
    text += record_line(record) + '\n';
  }
  return write(text);
}

Status RecordWriter::write(const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t count = ::write(descriptor_->number, text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0) {
      return fail(fmt::format("{}: cannot be written: {}", file_.string(), std::strerror(errno)));
    }
    done += static_cast<std::size_t>(count);
  }
  if (::fsync(descriptor_->number) != 0) {
    return fail(fmt::format("{}: cannot be written: {}", file_.string(), std::strerror(errno)));
  }
  return {};
}

}  // namespace stemvo::search
