// SPDX-License-Identifier: MIT
#include "pipeline/out_folder.hpp"

#include <algorithm>
#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::pipeline {
namespace fs = std::filesystem;

namespace {

constexpr const char* kMark = ".stemvo";

Error refuse(const fs::path& folder, const std::string& found) {
  return fail(fmt::format("{}: expected an output folder that can be written, found: {}",
                          folder.string(), found));
}

std::string mark_of(const std::string& command) {
  return fmt::format("Results of 'stemvo {}': its next run may replace them.\n", command);
}

Status check_may_be_replaced(const fs::path& folder, const std::string& command) {
  std::error_code code;
  if (!fs::is_directory(folder, code) || fs::is_empty(folder, code) ||
      is_folder_of(folder, command)) {
    return {};
  }
  return fail(
      fmt::format("{}: expected a new folder, an empty one or results of 'stemvo {}', found other "
                  "files",
                  folder.string(), command));
}

Status check_holds_none(const fs::path& folder, const std::vector<fs::path>& inputs) {
  std::error_code code;
  const fs::path root = fs::weakly_canonical(fs::absolute(folder, code), code);
  const auto is_below_root = [&root](const fs::path& path) {
    return std::ranges::mismatch(root, path).in1 == root.end();
  };
  const auto is_inside = [&](const fs::path& input) {
    const fs::path path = fs::absolute(input, code);
    // A link to a file may lie in the folder, or lead into it.
    return fs::exists(input, code) &&
           (is_below_root(fs::weakly_canonical(path.parent_path(), code)) ||
            is_below_root(fs::weakly_canonical(path, code).parent_path()));
  };
  const auto found = std::ranges::find_if(inputs, is_inside);
  return found == inputs.end()
             ? Status()
             : Status(fail(fmt::format("{}: expected a folder that holds no input, found {}",
                                       folder.string(), found->string())));
}

/// Error: another process has it. On a file system without locks it is taken without one.
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

}  // namespace

Status create_out_folder(const fs::path& folder) {
  std::error_code code;
  fs::create_directories(folder, code);
  return code ? Status(refuse(folder, code.message())) : Status();
}

bool is_folder_of(const fs::path& folder, const std::string& command) {
  const auto mark = read_text_file(folder / kMark, kMaxSettings_MB);
  return mark && *mark == mark_of(command);
}

Expected<fs::path> create_results_folder(const std::string& name) {
  const fs::path results = "results";
  STEMVO_TRY(create_out_folder(results));
  fs::path folder = results / name;
  std::error_code code;
  for (int i = 2; !fs::create_directory(folder, code) && !code; ++i) {
    folder = results / fmt::format("{}_{}", name, i);
  }
  return code ? Expected<fs::path>(refuse(folder, code.message())) : folder;
}

Expected<FolderLock> open_out_folder(const fs::path& folder,
                                     const std::string& command,
                                     const std::vector<fs::path>& inputs) {
  STEMVO_TRY(check_holds_none(folder, inputs));
  STEMVO_TRY(create_out_folder(folder));
  STEMVO_TRY_GET(FolderLock lock, lock_folder(folder));
  STEMVO_TRY(check_may_be_replaced(folder, command));
  const Status marked = write_text_file(folder / kMark, mark_of(command));
  return marked ? Expected<FolderLock>(lock) : refuse(folder, marked.error().message);
}

Status check_is_no_input(const fs::path& file, const std::vector<fs::path>& inputs) {
  for (const fs::path& input : inputs) {
    if (std::error_code code; fs::equivalent(file, input, code)) {
      return fail(fmt::format("{}: expected a file to write that is no input, found {}",
                              file.string(), input.string()));
    }
  }
  return {};
}

std::vector<fs::path> input_files(const FrameSourceRequest& request,
                                  const FrameSource& source,
                                  const Config& config) {
  std::vector<fs::path> files = source.files;
  files.insert(files.end(), {config.stem.model, source.ground_truth_file.value_or(""),
                             source.given_calibration.value_or(""), request.sequence_dir,
                             request.times.value_or(""), request.camera_file.value_or("")});
  files.insert(files.end(), request.masks.begin(), request.masks.end());
  return files;
}

}  // namespace stemvo::pipeline
