// SPDX-License-Identifier: MIT
#include "models/manifest.hpp"

#include <algorithm>
#include <charconv>
#include <map>
#include <span>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include "text/text_file.hpp"

namespace stemvo {
namespace {

// Far above any first layer, and small enough that no product of sizes overflows.
constexpr int kLargestNumber = 100000;

constexpr std::array<std::string_view, 12> kKeys = {
    "name",   "file",   "sha256",  "network",        "layer",   "filters",
    "kernel", "stride", "padding", "default_filter", "licence", "command"};
constexpr std::string_view kSampling = "sampling";
constexpr std::string_view kFolded = "folded";
constexpr std::array<std::string_view, 2> kOptionalKeys = {kSampling, kFolded};
constexpr std::array<std::string_view, 4> kFoldedKeys = {"filter", "sampling", "file", "sha256"};

/// An empty document has no mark.
int line_of(const YAML::Node& node) { return std::max(node.Mark().line, 0) + 1; }

using Keys = std::span<const std::string_view>;

/// Reads the keys of one map; keeps the first thing that is wrong, and where.
class EntryReader {
 public:
  EntryReader(const std::filesystem::path& source, const YAML::Node& node, Keys keys, Keys optional)
      : source_(source), keys_(keys), optional_(optional) {
    line_ = line_of(node);
    if (!node.IsMap()) {
      error(line_, fmt::format("expected the keys {} with values, found something else",
                               fmt::join(keys_, ", ")));
      return;
    }
    for (const auto& item : node) {
      add(item.first, item.second);
    }
    for (const std::string_view key : keys_) {
      if (values_.find(key) == values_.end()) {
        error(line_, fmt::format("missing key '{}'", key));
      }
    }
  }

  [[nodiscard]] const std::string& error() const { return error_; }
  [[nodiscard]] int line(std::string_view key) const {
    const auto found = values_.find(key);
    return found == values_.end() ? line_ : found->second.line;
  }
  void error(int line, const std::string& message) {
    if (error_.empty()) {
      error_ = fmt::format("{}:{}: {}", source_.string(), line, message);
    }
  }
  void take_error(const EntryReader& part) { error_ = error_.empty() ? part.error_ : error_; }

  std::string text(std::string_view key) {
    const YAML::Node node = find(key);
    const std::string value = node.IsScalar() ? node.Scalar() : std::string();
    if (value.empty()) {
      error(line(key), fmt::format("{}: expected a text, found none", key));
    }
    return value;
  }

  [[nodiscard]] bool has(std::string_view key) const { return values_.contains(key); }
  [[nodiscard]] YAML::Node find(std::string_view key) const {
    const auto found = values_.find(key);
    return found == values_.end() ? YAML::Node() : found->second.node;
  }

  /// A name beside the manifest, as an absolute path.
  std::filesystem::path file() {
    const std::filesystem::path name = text("file");
    if (name.has_parent_path()) {
      error(line("file"),
            fmt::format("file: expected a name beside the manifest, found '{}'", name.string()));
    }
    return std::filesystem::absolute(source_).parent_path() / name;
  }

  std::string sha256() {
    const auto is_hex = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
    const std::string value = text("sha256");
    if (value.size() != 64 || !std::all_of(value.begin(), value.end(), is_hex)) {
      error(
          line("sha256"),
          fmt::format("sha256: expected 64 digits 0-9 and a-f, found {} characters", value.size()));
    }
    return value;
  }

  /// False where the key is missing or says `any`.
  bool native_sampling() {
    if (!has(kSampling)) {
      return false;
    }
    const std::string value = text(kSampling);
    if (value != "any" && value != "native") {
      error(line(kSampling),
            fmt::format("{}: expected any or native, found '{}'", kSampling, value.substr(0, 40)));
    }
    return value == "native";
  }

  int number(std::string_view key, int min) { return number(key, find(key), min); }

  template <std::size_t N>
  std::array<int, N> numbers(std::string_view key, int min) {
    std::array<int, N> values{};
    const YAML::Node node = find(key);
    if (!node.IsSequence() || node.size() != N) {
      error(line(key), fmt::format("{}: expected a list of {} whole numbers", key, N));
      return values;
    }
    for (std::size_t i = 0; i < N; ++i) {
      values.at(i) = number(key, node[i], min);
    }
    return values;
  }

 private:
  struct Value {
    int line = 0;  ///< of the key: an empty value may be marked a line later
    YAML::Node node;
  };

  void add(const YAML::Node& key, const YAML::Node& value) {
    const std::string name = key.IsScalar() ? key.Scalar() : "?";
    for (const Keys keys : {keys_, optional_}) {
      const auto known = std::find(keys.begin(), keys.end(), name);
      if (known != keys.end()) {
        if (!values_.emplace(*known, Value{line_of(key), value}).second) {
          error(line_of(key), fmt::format("duplicated key '{}'", name));
        }
        return;
      }
    }
    error(line_of(key), fmt::format("unknown key '{}'; known keys: {}{}{}", name.substr(0, 40),
                                    fmt::join(keys_, ", "), optional_.empty() ? "" : ", ",
                                    fmt::join(optional_, ", ")));
  }

  int number(std::string_view key, const YAML::Node& node, int min) {
    const std::string text = node.IsScalar() ? node.Scalar() : std::string();
    int value = 0;
    const char* const end = text.data() + text.size();
    const auto [stop, problem] = std::from_chars(text.data(), end, value);
    if (text.empty() || problem != std::errc() || stop != end || value < min ||
        value > kLargestNumber) {
      error(line(key), fmt::format("{}: expected a whole number from {} to {}, found '{}'", key,
                                   min, kLargestNumber, text.substr(0, 40)));
    }
    return value;
  }

  const std::filesystem::path& source_;
  Keys keys_;
  Keys optional_;
  int line_ = 0;
  std::map<std::string_view, Value> values_;
  std::string error_;
};

void check_values(const ModelEntry& entry, EntryReader& reader) {
  if (entry.name == "gray" || entry.name == "input_layer" || entry.name.ends_with(".onnx")) {
    reader.error(reader.line("name"),
                 fmt::format("name: '{}' means something else in stem.model", entry.name));
  }
  if (entry.layer == "first") {
    reader.error(reader.line("layer"), "layer: 'first' means something else in stem.layer");
  }
  if (entry.default_filter >= entry.num_filters) {
    reader.error(reader.line("default_filter"),
                 fmt::format("default_filter: expected 0 to {}, found {}", entry.num_filters - 1,
                             entry.default_filter));
  }
  for (std::size_t side = 0; side < 4; ++side) {
    // A window wholly in the padding would see nothing of the frame.
    if (entry.padding_px.at(side) >= entry.kernel_px.at(side % 2)) {
      reader.error(reader.line("padding"),
                   fmt::format("padding: expected less than the kernel ({}), found {}",
                               entry.kernel_px.at(side % 2), entry.padding_px.at(side)));
    }
  }
}

/// The key `folded`, where there is one; what is wrong in it becomes the entry's error.
std::optional<FoldedFilter> read_folded(const std::filesystem::path& source,
                                        const ModelEntry& entry,
                                        EntryReader& reader) {
  if (!reader.has(kFolded)) {
    return std::nullopt;
  }
  EntryReader folded(source, reader.find(kFolded), kFoldedKeys, {});
  if (!folded.error().empty()) {
    reader.take_error(folded);
    return std::nullopt;
  }
  const FoldedFilter result{.filter = folded.number("filter", 0),
                            .sampling_px = folded.number("sampling", 1),
                            .file = folded.file(),
                            .sha256 = folded.sha256()};
  if (result.filter >= entry.num_filters) {
    folded.error(folded.line("filter"), fmt::format("filter: expected 0 to {}, found {}",
                                                    entry.num_filters - 1, result.filter));
  }
  if (entry.stride_px > 0 && entry.stride_px % result.sampling_px != 0) {
    folded.error(folded.line("sampling"),
                 fmt::format("sampling: expected a divisor of the stride {}, found {}",
                             entry.stride_px, result.sampling_px));
  }
  reader.take_error(folded);
  return result;
}

ModelEntry read_entry(const std::filesystem::path& source, EntryReader& reader) {
  ModelEntry entry;
  entry.name = reader.text("name");
  entry.file = reader.file();
  entry.sha256 = reader.sha256();
  entry.network = reader.text("network");
  entry.layer = reader.text("layer");
  entry.num_filters = reader.number("filters", 1);
  entry.kernel_px = reader.numbers<2>("kernel", 1);
  entry.stride_px = reader.number("stride", 1);
  entry.padding_px = reader.numbers<4>("padding", 0);
  entry.native_sampling_only = reader.native_sampling();
  entry.default_filter = reader.number("default_filter", 0);
  entry.folded = read_folded(source, entry, reader);
  entry.licence = reader.text("licence");
  entry.command = reader.text("command");
  check_values(entry, reader);
  return entry;
}

/// Entries of one name are layers of one file.
void check_against(const std::vector<ModelEntry>& others,
                   const ModelEntry& entry,
                   EntryReader& reader) {
  for (const ModelEntry& other : others) {
    if (other.name != entry.name) {
      continue;
    }
    if (other.layer == entry.layer) {
      reader.error(reader.line("name"), fmt::format("name: '{}' with layer '{}' stands here twice",
                                                    entry.name, entry.layer));
    } else if (other.file != entry.file || other.sha256 != entry.sha256) {
      reader.error(
          reader.line("file"),
          fmt::format("file: expected {} with the same sha256 as the other layers of '{}', "
                      "found {}",
                      other.file.filename().string(), entry.name, entry.file.filename().string()));
    }
  }
}

/// The list under the one key `models`.
Expected<YAML::Node> models_of(const std::filesystem::path& file, const std::string& text) {
  try {
    const YAML::Node root = YAML::Load(text);
    // size() counts a duplicated key twice, which is what we want here.
    if (!root.IsMap() || root.size() != 1 || !root["models"].IsDefined()) {
      return fail(
          fmt::format("{}:{}: expected the one key 'models'", file.string(), line_of(root)));
    }
    if (!root["models"].IsSequence()) {
      return fail(fmt::format("{}:{}: models: expected a list of models", file.string(),
                              line_of(root["models"])));
    }
    return root["models"];
  } catch (const YAML::Exception& error) {
    return fail(fmt::format("{}:{}: not YAML: {}", file.string(), error.mark.line + 1, error.msg));
  }
}

}  // namespace

Expected<std::vector<ModelEntry>> load_manifest(const std::filesystem::path& file) {
  const auto text = read_text_file(file);
  if (!text) {
    return text.error();
  }
  const auto models = models_of(file, *text);
  if (!models) {
    return models.error();
  }
  std::vector<ModelEntry> entries;
  for (const YAML::Node& node : *models) {
    EntryReader reader(file, node, kKeys, kOptionalKeys);
    ModelEntry entry = reader.error().empty() ? read_entry(file, reader) : ModelEntry();
    if (reader.error().empty()) {
      check_against(entries, entry, reader);
    }
    if (!reader.error().empty()) {
      return fail(reader.error());
    }
    entries.push_back(std::move(entry));
  }
  return entries;
}

}  // namespace stemvo
