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

#include "dataset/listing.hpp"
#include "models/manifest.hpp"
#include "text/spared_inputs.hpp"
#include "text/text_file.hpp"

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

}  // namespace

Status create_out_folder(const fs::path& folder) {
  const auto refuse = [&folder](const std::string& found) {
    return fail(fmt::format("{}: expected an output folder that can be written, found: {}",
                            folder.string(), found));
  };
  std::error_code code;
  fs::create_directories(folder, code);
  std::error_code ignored;
  if (fs::exists(folder, ignored) && !fs::is_directory(folder, ignored)) {
    return refuse(fmt::format("{} of that name", kind_of(folder)));
  }
  if (code) {
    return refuse(code.message());
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

namespace {

/// Nobody reads a pipe whose bytes come at the end of a run.
Status check_are_no_pipes(const std::vector<fs::path>& outputs) {
  for (const fs::path& file : outputs) {
    std::error_code ignored;
    if (fs::is_fifo(file, ignored) || fs::is_socket(file, ignored)) {
      return fail(
          fmt::format("{}: expected a file to write, found {}", file.string(), kind_of(file)));
    }
  }
  return {};
}

/// trajectory.png would be a frame of the next run.
Status check_holds_no_images(const fs::path& folder, const std::vector<fs::path>& inputs) {
  for (const fs::path& input : inputs) {
    std::error_code code;
    if (dataset::is_image_file(input) && fs::equivalent(input.parent_path(), folder, code)) {
      return fail(fmt::format("{}: expected a folder without the recording's images, found {}",
                              folder.string(), input.filename().string()));
    }
  }
  return {};
}

}  // namespace

Expected<FolderLock> open_out_folder(const fs::path& folder,
                                     const std::vector<std::string>& names,
                                     const std::vector<fs::path>& inputs) {
  std::vector<fs::path> outputs;
  for (const std::string& name : names) {
    outputs.push_back(folder / name);
  }
  const Status status = check_spares_inputs(outputs, inputs)
                            .and_then([&] { return check_are_no_pipes(outputs); })
                            .and_then([&] { return check_holds_no_images(folder, inputs); })
                            .and_then([&] { return create_out_folder(folder); });
  return status ? lock_folder(folder) : status.error();
}

std::vector<fs::path> input_files(const FrameSource& source,
                                  const Config& config,
                                  const fs::path& models_dir) {
  std::vector<fs::path> files = source.frames().files;
  files.insert(files.end(), {config.file, config.stem.model, models_dir / "manifest.yaml"});
  for (const auto& file : {source.ground_truth_file(), source.given_calibration()}) {
    if (file) {
      files.push_back(*file);
    }
  }
  if (!source.frames().files.empty()) {
    const fs::path folder = source.file(0).parent_path();
    for (const char* name :
         {"calib.txt", "times.txt", "camera.yaml", "rgb.txt", "data.csv", "sensor.yaml"}) {
      files.insert(files.end(), {folder / name, folder.parent_path() / name});
    }
  }
  if (const auto model = find_model(config.stem.model, config.stem.layer, models_dir)) {
    files.push_back(model->file);
  }
  return files;
}

std::vector<fs::path> input_files(const FrameSourceRequest& request,
                                  const FrameSource& source,
                                  const Config& config,
                                  const fs::path& models_dir) {
  std::vector<fs::path> files = input_files(source, config, models_dir);
  for (const auto& file : {request.times, request.camera_file}) {
    files.push_back(file.value_or(""));
  }
  files.insert(files.end(), request.masks.begin(), request.masks.end());
  return files;
}

}  // namespace stemvo::pipeline
