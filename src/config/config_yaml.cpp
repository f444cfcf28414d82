// SPDX-License-Identifier: MIT
#include "config/config_yaml.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <ranges>
#include <sstream>

#include <fmt/ranges.h>
#include <yaml-cpp/eventhandler.h>

#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::config {
namespace {

bool is_section(std::string_view name, const std::vector<Key>& keys) {
  return !name.empty() && std::ranges::find(keys, name, &Key::section) != keys.end();
}

/// Pairs of letters that two names share, of all that they have: 0 to 1.
double likeness(std::string_view a, std::string_view b) {
  double num_shared = 0.0;
  for (std::size_t i = 0; i + 1 < a.size(); ++i) {
    num_shared += b.find(a.substr(i, 2)) != std::string_view::npos ? 1.0 : 0.0;
  }
  return 2.0 * num_shared / static_cast<double>(std::max(a.size() + b.size(), std::size_t{3}) - 2);
}

std::string like_name(const std::string& name, const std::vector<Key>& keys) {
  constexpr double kMinLikeness = 0.6;
  double best = kMinLikeness;
  std::string nearest;
  for (const Key& key : keys) {
    const std::string known = options::full_name(key.section, key.key);
    if (const double found = likeness(name, known); found > best) {
      best = found;
      nearest = fmt::format("; did you mean {}?", known);
    }
  }
  return nearest;
}

std::string unknown_key(std::string_view section,
                        const std::string& key,
                        const std::vector<Key>& keys) {
  const bool is_top = !is_section(section, keys);
  std::vector<std::string_view> known;
  for (const Key& other : keys) {
    const std::string_view name = is_top && !other.section.empty() ? other.section : other.key;
    if ((is_top || other.section == section) && std::ranges::find(known, name) == known.end()) {
      known.push_back(name);
    }
  }
  return fmt::format("unknown key; known keys{}: {}{}",
                     is_top ? "" : fmt::format(" of {}", section), fmt::join(known, ", "),
                     like_name(options::full_name(section, key), keys));
}

int line_of(const YAML::Node& node) { return node.Mark().line + 1; }

std::string_view kind_of(const YAML::Node& node) {
  return node.IsSequence() ? "a list"
         : node.IsMap()    ? "a group of keys"
         : node.IsScalar() ? "a value"
                           : "nothing";
}

/// Finds where documents begin: YAML::Load reads the first and leaves out others without a word,
/// and YAML::LoadAll never ends on some texts.
class DocumentLines final : public YAML::EventHandler {
  using Text = const std::string&;
  using Style = YAML::EmitterStyle::value;

 public:
  std::vector<int> lines;

  void OnDocumentStart(const YAML::Mark& mark) override { lines.push_back(mark.line + 1); }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, Text, YAML::anchor_t, Text) override {}
  void OnSequenceStart(const YAML::Mark&, Text, YAML::anchor_t, Style) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, Text, YAML::anchor_t, Style) override {}
  void OnMapEnd() override {}
};

}  // namespace

Status read_map(const YAML::Node& map,
                std::string_view section,
                std::string_view source,
                std::vector<Key>& keys) {
  const auto error = [&](const YAML::Node& node, const std::string& message) {
    return fail(fmt::format("{}:{}: {}", source, line_of(node), message));
  };
  if (map.IsNull()) {
    return {};  // an empty file, or a section whose keys are all commented out
  }
  if (!map.IsMap()) {
    const std::string where = section.empty() ? "" : fmt::format("{}: ", section);
    return error(map, fmt::format("{}expected keys with values, found {}", where, kind_of(map)));
  }
  std::map<std::string, int> first_line;
  for (const auto& entry : map) {
    const YAML::Node& key_node = entry.first;
    const std::string& key = key_node.Scalar();
    const std::string name = one_line(options::full_name(section, key));
    // yaml-cpp keeps both entries of a duplicated key without a word.
    const auto [first, is_new] = first_line.emplace(key, line_of(key_node));
    if (!is_new) {
      return error(key_node, fmt::format("{}: duplicated key; it stands on line {} already", name,
                                         first->second));
    }
    if (section.empty() && is_section(key, keys)) {
      STEMVO_TRY(read_map(entry.second, key, source, keys));
    } else if (const std::string problem = read_key(section, key, entry.second, keys);
               !problem.empty()) {
      return error(key_node, fmt::format("{}: {}", name, problem));
    }
  }
  return {};
}

Expected<YAML::Node> parse_document(const std::string& text, std::string_view source) {
  try {
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    DocumentLines documents;
    if (parser.HandleNextDocument(documents) && parser.HandleNextDocument(documents)) {
      return fail(fmt::format("{}:{}: not YAML: expected one document, found more behind it",
                              source, documents.lines.back()));
    }
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    return fail(fmt::format("{}:{}: not YAML: {}", source, error.mark.line + 1, error.msg));
  }
}

Expected<YAML::Node> read_document(const std::filesystem::path& file) {
  STEMVO_TRY_GET(const std::string text, read_text_file(file, kMaxSettings_MB));
  return parse_document(text, file.string());
}

std::string parse(const YAML::Node& node, std::string& value) {
  if (!node.IsScalar()) {
    return fmt::format("expected one value, found {}", kind_of(node));
  }
  value = node.Scalar();
  return {};
}

std::string parse(const YAML::Node& node, bool& value) {
  std::string text;
  const std::string problem = parse(node, text);
  value = text == "true" || text == "on";
  return !problem.empty() || value || text == "false" || text == "off"
             ? problem
             : fmt::format("expected true or false, found '{}'", one_line(text));
}

template <options::Number N>
std::string parse(const YAML::Node& node, N& value) {
  std::string text;
  if (std::string problem = parse(node, text); !problem.empty()) {
    return problem;
  }
  const std::optional<N> number = to_number<N>(text);
  value = number.value_or(N{});
  const char* kind = std::is_floating_point_v<N> ? "a number"
                     : std::is_unsigned_v<N>     ? "a whole number of at least 0"
                                                 : "a whole number";
  return number ? "" : fmt::format("expected {}, found '{}'", kind, one_line(text));
}
template std::string parse(const YAML::Node&, int&);
template std::string parse(const YAML::Node&, double&);
template std::string parse(const YAML::Node&, std::uint64_t&);

std::string parse(const YAML::Node& node, std::vector<double>& value) {
  if (node.IsScalar()) {
    const Expected<YAML::Node> list = parse_document(node.Scalar(), "value");
    if (!list || list->IsSequence()) {
      return list ? parse(*list, value) : list.error().message;
    }
  }
  if (!node.IsSequence()) {
    return fmt::format("expected a list of numbers like [100, 200], found {}", kind_of(node));
  }
  for (const YAML::Node& element : node) {
    if (const std::string problem = parse(element, value.emplace_back()); !problem.empty()) {
      return problem;
    }
  }
  return {};
}

/// The shortest text that reads back to the same double, with a point.
std::string format(double value) {
  const std::string text = fmt::format("{}", value);
  const bool is_whole = text.find_first_not_of("-0123456789") == std::string::npos;
  return is_whole ? text + ".0" : text;
}

std::string format(const std::string& value) {
  YAML::Emitter out;
  out << value;
  return out.c_str();
}

std::string format(const std::vector<double>& value) {
  const auto texts = value | std::views::transform([](double number) { return format(number); });
  return fmt::format("[{}]", fmt::join(texts, ", "));
}

std::string read_key(std::string_view section,
                     const std::string& key,
                     const YAML::Node& value,
                     std::vector<Key>& keys) {
  const auto found = std::ranges::find_if(
      keys, [&](const Key& k) { return k.section == section && k.key == key; });
  if (found == keys.end()) {
    return unknown_key(section, key, keys);
  }
  found->is_given = true;
  return found->read(value);
}

}  // namespace stemvo::config
