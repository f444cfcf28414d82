// SPDX-License-Identifier: MIT
#include "pipeline/earlier_run.hpp"

#include <algorithm>
#include <system_error>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "report/frames_csv.hpp"
#include "text/text_file.hpp"

namespace stemvo::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kResults[] = {"metrics.json",
                                    "trajectory_kitti.txt",
                                    "report.html",
                                    "trajectory.png",
                                    "trajectory_tum.txt",
                                    "trajectory_refined_kitti.txt",
                                    "trajectory_refined_tum.txt",
                                    "map.ply"};

bool is_own_file(const fs::path& file) {
  std::error_code code;
  return fs::is_regular_file(fs::symlink_status(file, code));
}

}  // namespace

bool has_earlier_run(const fs::path& out_dir) {
  const auto frames = read_text_file(out_dir / "frames.csv");
  return frames && frames->starts_with(frames_csv_header());
}

std::vector<std::string> run_files() {
  std::vector<std::string> names(std::begin(kResults), std::end(kResults));
  names.insert(names.end(), {"frames.csv", "config.yaml"});
  return names;
}

std::vector<fs::path> old_pictures(const fs::path& out_dir) {
  const fs::path folder = out_dir / "pictures";
  std::error_code code;
  if (!fs::is_directory(fs::symlink_status(folder, code))) {
    return {};
  }
  std::vector<fs::path> found = dataset::list_folder(folder).value_or(std::vector<fs::path>());
  std::erase_if(found, [](const fs::path& file) {
    // A kill may have left one unfinished.
    const fs::path name = file.extension() == ".unfinished" ? file.stem() : file.filename();
    const std::string stem = name.stem().string();
    const bool is_number = stem.size() == 6 && stem.find_first_not_of("0123456789") == stem.npos;
    return !is_number || name.extension() != ".png" || !is_own_file(file);
  });
  return found;
}

Status check_pictures(const fs::path& out_dir) {
  const fs::path folder = out_dir / "pictures";
  std::error_code code;
  if (fs::is_symlink(folder, code)) {
    return fail(
        fmt::format("{}: expected a folder of the results' own, found a link", folder.string()));
  }
  const auto found = old_pictures(out_dir);
  return found.empty() || has_earlier_run(out_dir)
             ? Status()
             : Status(fail(fmt::format("{}: expected images of an earlier run, with its frames.csv "
                                       "in {}, or none, found {}; give another --out",
                                       folder.string(), out_dir.string(),
                                       found.front().filename().string())));
}

Status remove_earlier_results(const fs::path& out_dir) {
  if (!has_earlier_run(out_dir)) {
    return {};
  }
  std::vector<fs::path> files = old_pictures(out_dir);
  for (const char* name : kResults) {
    if (is_own_file(out_dir / name)) {
      files.push_back(out_dir / name);
    }
  }
  for (const fs::path& file : files) {
    if (Status status = remove_file(file); !status) {
      return status;
    }
  }
  std::error_code ignored;
  if (fs::is_directory(fs::symlink_status(out_dir / "pictures", ignored))) {
    fs::remove(out_dir / "pictures", ignored);  // where it is empty
  }
  return write_text_file(out_dir / "frames.csv", frames_csv_header());
}

}  // namespace stemvo::pipeline
