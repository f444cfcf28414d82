// SPDX-License-Identifier: MIT
#include "config/config_yaml.hpp"

#include <algorithm>
#include <charconv>
#include <map>
#include <sstream>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/eventhandler.h>

namespace stemvo::config {
namespace {

/// Keys, and values, that had another name once.
constexpr std::pair<std::string_view, std::string_view> kRenamed[] = {
    {"odometry.standing_flow_px", "odometry.stationary_flow_px"},
    {"refine.every", "ba.every_n_keyframes"},
    {"refine.loss_px", "ba.loss_px"},
    {"refine.max_iterations", "ba.max_iterations"},
    {"refine.window", "window.num_keyframes"},
    {"scale.constant_m", "scale.step_m"},
    {"scale.joining", "scale.temporal_filter"},
    {"scale.source=constant", "scale.source=constant_speed"},
    {"stem.stretch_high_percent", "stem.contrast_high_percent"},
    {"stem.stretch_low_percent", "stem.contrast_low_percent"},
    {"stem.stretch_memory", "stem.contrast_memory"},
    {"stem.tracking_resolution=bicubic", "stem.tracking_resolution=input"},
    {"stem.tracking_resolution=frame", "stem.tracking_resolution=input_zoomed"},
    {"stem.upsample", "stem.tracking_resolution"},
};

/// "; its name is ... now", or nothing.
std::string new_name(const std::string& key) {
  const auto* const renamed =
      std::ranges::find(kRenamed, key, &std::pair<std::string_view, std::string_view>::first);
  return renamed == std::end(kRenamed) ? "" : fmt::format("; its name is {} now", renamed->second);
}

bool had_keys(const std::string& section) {
  return !section.empty() && std::ranges::any_of(kRenamed, [&](const auto& renamed) {
    return renamed.first.starts_with(section + ".");
  });
}

/// Whole text or nothing; a leading '+' is allowed as in YAML.
template <typename Number>
bool parse_decimal(std::string_view text, Number& value) {
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') {
    text.remove_prefix(1);
  }
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);  // NOLINT: it has an end
  return error == std::errc() && stop == end;
}

std::string expected(std::string_view kind, std::string_view text) {
  return fmt::format("expected {}, found {}", kind, quote(text));
}

/// Shortest text that reads back to the same double, and reads as a number with a point.
std::string format_number(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_not_of("-0123456789") == std::string::npos) {
    text += ".0";
  }
  return text;
}

std::string format_text(const std::string& value) {
  const std::string plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_./-";
  const bool is_plain = value.find_first_not_of(plain) == std::string::npos;
  const bool is_word = !value.empty() && value.front() != '-';
  const bool is_null = YAML::IsNullString(value);
  YAML::Emitter out;
  if (is_plain && is_word && !is_null) {
    out << value;
  } else {
    out << YAML::DoubleQuoted << value;
  }
  return out.c_str();
}

std::string format_list(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) {
    text += (text.empty() ? "" : ", ") + format_number(value);
  }
  return "[" + text + "]";
}

std::string parse_number(std::string_view text, double& value) {
  return parse_decimal(text, value) ? std::string() : expected("a number", text);
}

std::string parse_choice(const Field& field, const EnumValue& value, std::string_view text) {
  const Rule& rule = field.rule;
  const auto found = std::find(rule.choices.begin(), rule.choices.end(), text);
  if (found == rule.choices.end()) {
    return not_a_choice(rule, text) + new_name(fmt::format("{}={}", field.name(), text));
  }
  value.set(value.target, static_cast<int>(found - rule.choices.begin()));
  return {};
}

int line_of(const YAML::Node& node) { return node.Mark().line + 1; }

std::string_view kind_of(const YAML::Node& node) {
  switch (node.Type()) {
    case YAML::NodeType::Sequence:
      return "a list";
    case YAML::NodeType::Map:
      return "a group of keys";
    case YAML::NodeType::Scalar:
      return "a value";
    default:
      return "nothing";
  }
}

bool is_section(std::string_view name, const std::vector<Field>& fields) {
  return !name.empty() && std::any_of(fields.begin(), fields.end(),
                                      [name](const Field& f) { return f.section == name; });
}

std::string read_list(const YAML::Node& node, std::vector<double>& values) {
  values.clear();
  for (const YAML::Node& element : node) {
    if (!element.IsScalar()) {
      return fmt::format("expected a list of numbers, found {} in it", kind_of(element));
    }
    double value = 0.0;
    if (std::string problem = parse_number(element.Scalar(), value); !problem.empty()) {
      return problem;
    }
    values.push_back(value);
  }
  return {};
}

/// Reads one scalar into a field that is no list. Nothing, or "expected ..., found ...".
std::string parse_scalar(const Field& field, std::string_view text) {
  const auto parse_as = [text](std::string_view kind, auto* value) {
    return parse_decimal(text, *value) ? std::string() : expected(kind, text);
  };
  return std::visit(
      Overloaded{
          [&](const EnumValue& value) { return parse_choice(field, value, text); },
          [&](std::string* value) {
            *value = text;
            return std::string();
          },
          [&](bool* value) {
            *value = text == "true";
            return *value || text == "false" ? std::string() : expected("true or false", text);
          },
          [&](double* value) { return parse_as("a number", value); },
          [&](int* value) { return parse_as("a whole number", value); },
          [&](std::uint64_t* value) { return parse_as("a whole number of at least 0", value); },
          [&](std::vector<double>*) { return expected("a list of numbers like [100, 200]", text); },
      },
      field.value);
}

/// The same of a scalar or a list.
std::string read_value(const YAML::Node& node, const Field& field) {
  std::string problem;
  if (auto* const* list = std::get_if<std::vector<double>*>(&field.value);
      list != nullptr && node.IsSequence()) {
    problem = read_list(node, **list);
  } else if (node.IsScalar()) {
    problem = parse_scalar(field, node.Scalar());
  } else {
    problem = fmt::format("expected {}, found {}",
                          list != nullptr ? "a list of numbers" : "one value", kind_of(node));
  }
  return problem.empty() ? violation_of(field) : problem;
}

/// Where documents begin. Throws at more keys and values than any of our files has: yaml-cpp takes
/// 50 us to load one.
class DocumentMarks final : public YAML::EventHandler {
 public:
  std::vector<int> lines;

  void OnDocumentStart(const YAML::Mark& mark) override { lines.push_back(mark.line + 1); }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { count(mark); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { count(mark); }
  void OnScalar(const YAML::Mark& mark,
                const std::string&,
                YAML::anchor_t,
                const std::string&) override {
    count(mark);
  }
  void OnSequenceStart(const YAML::Mark& mark,
                       const std::string&,
                       YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    count(mark);
  }
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark& mark,
                  const std::string&,
                  YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    count(mark);
  }
  void OnMapEnd() override {}

 private:
  void count(const YAML::Mark& mark) {
    constexpr int kMaxNodes = 10000;
    if (++num_nodes_ > kMaxNodes) {
      throw YAML::ParserException(
          mark, fmt::format("expected at most {} keys and values, found more", kMaxNodes));
    }
  }

  int num_nodes_ = 0;
};

/// Walks one YAML map, top level (section empty) or section.
class MapReader {
 public:
  MapReader(std::string_view source, std::vector<Field>& fields)
      : source_(source), fields_(fields) {}

  Status read(const YAML::Node& map, std::string_view section) {
    if (map.IsNull()) {
      return {};  // an empty file, or a section whose keys are all commented out
    }
    if (!map.IsMap()) {
      const std::string where = section.empty() ? "" : fmt::format("{}: ", section);
      return error(map, fmt::format("{}expected keys with values, found {}", where, kind_of(map)));
    }
    std::map<std::string, int> first_line;
    for (const auto& entry : map) {
      if (!entry.first.IsScalar()) {
        return error(entry.first, fmt::format("expected a key, found {}", kind_of(entry.first)));
      }
      const std::string& key = entry.first.Scalar();
      // yaml-cpp keeps both entries of a duplicated key without a word.
      const auto [first, is_new] = first_line.emplace(key, line_of(entry.first));
      if (!is_new) {
        return error(entry.first, fmt::format("{}: duplicated key; it stands on line {} already",
                                              full_name(section, key), first->second));
      }
      if (Status status = read_entry(entry.first, entry.second, section); !status) {
        return status;
      }
    }
    return {};
  }

 private:
  Status read_entry(const YAML::Node& key_node, const YAML::Node& value, std::string_view section) {
    const std::string& key = key_node.Scalar();
    if (section.empty() && (is_section(key, fields_) || (value.IsMap() && had_keys(key)))) {
      return read(value, key);
    }
    const auto field = std::find_if(fields_.begin(), fields_.end(), [&](const Field& f) {
      return f.section == section && f.key == key;
    });
    const bool is_known = field != fields_.end();
    const std::string problem =
        is_known ? read_value(value, *field) : unknown_key(section, key, fields_);
    if (!problem.empty()) {
      return error(key_node, fmt::format("{}: {}", full_name(section, quoted_key(key)), problem));
    }
    field->is_given = true;
    return {};
  }

  static std::string full_name(std::string_view section, const std::string& key) {
    return section.empty() ? key : fmt::format("{}.{}", section, key);
  }
  /// A key of strange characters must not break the one line.
  static std::string quoted_key(const std::string& key) {
    const std::string shown = quote(key);
    return shown.size() == key.size() + 2 ? shown.substr(1, key.size()) : shown;
  }
  Error error(const YAML::Node& node, const std::string& message) const {
    return fail(fmt::format("{}:{}: {}", source_, line_of(node), message));
  }

  std::string_view source_;
  std::vector<Field>& fields_;
};

}  // namespace

std::string read_assigned(const std::string& text, const Field& field) {
  if (!std::holds_alternative<std::vector<double>*>(field.value)) {
    const std::string problem = parse_scalar(field, text);
    return problem.empty() ? violation_of(field) : problem;
  }
  const Expected<YAML::Node> value = parse_document(text, "value");
  return value ? read_value(*value, field) : value.error().message;
}

std::string format_value(const Field& field) {
  return std::visit(Overloaded{
                        [&](const EnumValue& value) {
                          return std::string(field.rule.choices.at(
                              static_cast<std::size_t>(value.get(value.target))));
                        },
                        [](const std::string* value) { return format_text(*value); },
                        [](const double* value) { return format_number(*value); },
                        [](const std::vector<double>* values) { return format_list(*values); },
                        [](const auto* value) { return fmt::format("{}", *value); },
                    },
                    field.value);
}

std::string unknown_key(std::string_view section,
                        std::string_view key,
                        const std::vector<Field>& fields) {
  if (const std::string renamed = new_name(fmt::format("{}.{}", section, key)); !renamed.empty()) {
    return "unknown key" + renamed;
  }
  const bool is_top = !is_section(section, fields);
  std::vector<std::string_view> known;
  for (const Field& field : fields) {
    const std::string_view name = is_top && !field.section.empty() ? field.section : field.key;
    const bool belongs = is_top || field.section == section;
    if (belongs && std::find(known.begin(), known.end(), name) == known.end()) {
      known.push_back(name);
    }
  }
  const std::string of = is_top ? "" : fmt::format(" of {}", section);
  const bool is_dumped = std::ranges::find(fields, "odometry", &Field::section) != fields.end();
  return fmt::format("unknown key; known keys{}: {}{}", of, fmt::join(known, ", "),
                     is_dumped ? " ('stemvo --dump-config' explains each)" : "");
}

Expected<YAML::Node> parse_document(const std::string& text, std::string_view source) {
  try {
    // YAML::LoadAll does not end where a comma stands behind the document.
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    DocumentMarks marks;
    while (marks.lines.size() < 2 && parser.HandleNextDocument(marks)) {
    }
    if (marks.lines.size() > 1) {
      return fail(fmt::format("{}:{}: not YAML: expected one document, found more behind it",
                              source, marks.lines[1]));
    }
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    return fail(fmt::format("{}:{}: not YAML: {}", source, error.mark.line + 1, error.msg));
  }
}

Status read_document(const YAML::Node& root, std::string_view source, std::vector<Field>& fields) {
  return MapReader(source, fields).read(root, "");
}

}  // namespace stemvo::config
