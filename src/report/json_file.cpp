// SPDX-License-Identifier: MIT
#include "report/json_file.hpp"

#include <string>

#include <fmt/format.h>

#include "text/text_file.hpp"

namespace stemvo {
namespace {
using Json = nlohmann::ordered_json;
}  // namespace

Expected<Json> read_json_object(const std::filesystem::path& file, bool has_comments) {
  const Expected<std::string> text = read_text_file(file, kMaxSettings_MB);
  if (!text) {
    return text.error();
  }
  try {
    Json json = Json::parse(*text, nullptr, true, has_comments);
    if (json.is_object()) {
      return json;
    }
    return fail(
        fmt::format("{}: expected a JSON object, found {}", file.string(), json.type_name()));
  } catch (const Json::exception& error) {
    const std::string what = error.what();  // "[json.exception.parse_error.101] parse error at .."
    return fail(
        fmt::format("{}: not JSON: {}", file.string(), one_line(what.substr(what.find("] ") + 2))));
  }
}

}  // namespace stemvo
