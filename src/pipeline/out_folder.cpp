// SPDX-License-Identifier: MIT
#include "pipeline/out_folder.hpp"

#include <system_error>

#include <fmt/format.h>

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

Status open_out_folder(const fs::path& folder, const std::string& command) {
  STEMVO_TRY(create_out_folder(folder));
  STEMVO_TRY(check_may_be_replaced(folder, command));
  const Status marked = write_text_file(folder / kMark, mark_of(command));
  return marked ? marked : Status(refuse(folder, marked.error().message));
}

}  // namespace stemvo::pipeline
