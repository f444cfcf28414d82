// SPDX-License-Identifier: MIT
#include "report/json_file.hpp"

#include <algorithm>
#include <cstddef>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "options/option_fields.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

using Json = nlohmann::ordered_json;

/// Told what stands in a text, one thing after the other; says what is wrong with it.
class JsonCheck final : public nlohmann::json_sax<Json> {
 public:
  std::string problem;

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool start_array(std::size_t) override { return open(); }
  bool end_array() override { return close(); }
  bool start_object(std::size_t) override { return open(); }
  bool end_object() override { return close(); }
  bool key(string_t& name) override {
    constexpr std::size_t kMaxKeys = 1000;
    std::set<std::string>& keys = keys_.back();
    if (!keys.insert(name).second) {
      problem = fmt::format("expected the key {} once, found it twice", options::quote(name));
    } else if (keys.size() > kMaxKeys) {
      problem = fmt::format("expected at most {} keys in an object, found more", kMaxKeys);
    }
    return problem.empty();
  }
  bool parse_error(std::size_t,
                   const std::string&,
                   const nlohmann::detail::exception& error) override {
    const std::string what = error.what();  // "[json.exception.parse_error.101] parse error at .."
    problem = one_line("not JSON: " + what.substr(std::min(what.find("] ") + 2, what.size())));
    return false;
  }

 private:
  bool open() {
    constexpr std::size_t kMaxDepth = 64;  // they are copied and destroyed by recursion
    keys_.emplace_back();
    if (keys_.size() > kMaxDepth) {
      problem = fmt::format("expected at most {} levels, found more", kMaxDepth);
    }
    return problem.empty();
  }
  bool close() {
    keys_.pop_back();
    return true;
  }

  std::vector<std::set<std::string>> keys_;  ///< of the objects that are open; a list has none
};

/// Errors do not name the file.
Expected<Json> parse_json(std::string_view text, bool has_comments) {
  JsonCheck check;
  return Json::sax_parse(text, &check, Json::input_format_t::json, /*strict=*/true, has_comments)
             ? Expected<Json>(Json::parse(text, nullptr, true, has_comments))
             : fail(check.problem);
}

}  // namespace

Expected<Json> read_json_object(const std::filesystem::path& file, bool has_comments) {
  const Expected<std::string> text = read_text_file(file, kMaxSettings_MB);
  if (!text) {
    return text.error();
  }
  Expected<Json> json = parse_json(*text, has_comments);
  if (json && !json->is_object()) {
    json = fail(fmt::format("expected a JSON object, found {}", json->type_name()));
  }
  return json ? std::move(json) : fail(fmt::format("{}: {}", file.string(), json.error().message));
}

}  // namespace stemvo
