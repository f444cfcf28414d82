// SPDX-License-Identifier: MIT
#include "pipeline/out_folder.hpp"

#include <cerrno>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include "dataset/frame_files.hpp"

namespace stemvo::pipeline {

namespace fs = std::filesystem;

namespace {

/// A file that is gone when it is closed, however the process ends; -1: errno says why not.
int open_nameless(const fs::path& folder) {
  const int file = ::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600);
  if (file >= 0 || (errno != EOPNOTSUPP && errno != EISDIR)) {
    return file;
  }
  const fs::path probe = folder / ".stemvo_probe";  // a file system without such files
  const int named = ::open(probe.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
  if (named >= 0) {
    ::unlink(probe.c_str());
  }
  return named;
}

std::vector<fs::path> old_frames(const fs::path& folder) {
  std::vector<fs::path> found = dataset::list_folder(folder).value_or(std::vector<fs::path>());
  std::erase_if(found, [](const fs::path& file) {
    const std::string stem = file.stem().string();
    const bool is_number = stem.size() == 6 && stem.find_first_not_of("0123456789") == stem.npos;
    std::error_code code;
    return !is_number || file.extension() != ".png" || !fs::is_regular_file(file, code);
  });
  return found;
}

}  // namespace

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
  const int file = open_nameless(folder);
  constexpr std::string_view kText = "can be written\n";
  const bool is_written = file >= 0 && ::write(file, kText.data(), kText.size()) > 0;
  const int error = errno;
  if (file >= 0) {
    ::close(file);
  }
  return is_written ? Status() : Status(refuse(std::generic_category().message(error)));
}

Expected<FolderLock> lock_folder(const fs::path& folder) {
  const int file = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const FolderLock lock(nullptr, [file](void*) {
    if (file >= 0) {
      ::close(file);
    }
  });
  if (file >= 0 && ::flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    return fail(
        fmt::format("{}: expected a folder that no other stemvo writes to, found one at "
                    "work in it",
                    folder.string()));
  }
  return lock;
}

Expected<FolderLock> open_out_folder(const fs::path& folder) {
  const Status status = create_out_folder(folder);
  return status ? lock_folder(folder) : status.error();
}

Status prepare_pictures(const fs::path& out_dir) {
  const fs::path folder = out_dir / "pictures";
  std::error_code code;
  if (fs::is_symlink(folder, code)) {
    return fail(
        fmt::format("{}: expected a folder of the results' own, found a link", folder.string()));
  }
  if (const Status status = create_out_folder(folder); !status) {
    return status;
  }
  for (const fs::path& file : old_frames(folder)) {
    if (!fs::exists(out_dir / "frames.csv", code)) {
      return fail(
          fmt::format("{}: expected images of an earlier run, with its frames.csv in {}, "
                      "or none, found {}",
                      folder.string(), out_dir.string(), file.filename().string()));
    }
    if (!fs::remove(file, code) && code) {
      return fail(fmt::format("{}: an earlier run's frame cannot be removed ({})", file.string(),
                              code.message()));
    }
  }
  return {};
}

std::vector<fs::path> input_files(const FrameSource& source, const Config& config) {
  std::vector<fs::path> files = source.frames().files;
  files.insert(files.end(), {config.file, config.stem.model});
  for (const auto& file : {source.ground_truth_file(), source.given_calibration()}) {
    if (file) {
      files.push_back(*file);
    }
  }
  return files;
}

}  // namespace stemvo::pipeline
