// SPDX-License-Identifier: MIT
#include "models/manifest.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "stem/hand_made.hpp"
#include "stem/model_file.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;
using options::Field;
using options::Rule;

/// An empty document has no mark.
int line_of(const YAML::Node& node) { return std::max(node.Mark().line, 0) + 1; }

class EntryReader {
 public:
  EntryReader(const fs::path& source, const YAML::Node& node) : source_(source), node_(node) {}

  /// `others` stand before it.
  Expected<ModelEntry> read(const std::vector<ModelEntry>& others) {
    Status status = read_keys();
    status = status ? set_files() : status;
    status = status ? set_window() : status;
    status = status ? check_names() : status;
    status = status ? check_filters() : status;
    status = status ? check_against(others) : status;
    return status ? Expected<ModelEntry>(std::move(entry_)) : status.error();
  }

 private:
  std::vector<Field> fields() {
    const Rule filters = Rule::between(1, internal::kMaxFilters);
    const Rule filter = Rule::between(0, internal::kMaxFilters - 1);
    const Rule kernel = Rule::between(1, internal::kMaxKernel_px);
    const Rule stride = Rule::between(1, internal::kMaxStride_px);
    const Rule padding = Rule::between(0, internal::kMaxKernel_px);
    return {{"", "name", &entry_.name, {}, ""},
            {"", "file", &file_, {}, ""},
            {"", "sha256", &entry_.sha256, {}, ""},
            {"", "network", &entry_.network, {}, ""},
            {"", "layer", &entry_.layer, {}, ""},
            {"", "filters", &entry_.num_filters, filters, ""},
            {"", "kernel", &kernel_, kernel, ""},
            {"", "stride", &entry_.stride_px, stride, ""},
            {"", "padding", &padding_, padding, ""},
            {"", "default_filter", &entry_.default_filter, filter, ""},
            {"", "licence", &entry_.licence, {}, ""},
            {"", "command", &entry_.command, {}, ""},
            {"", "sampling", &sampling_, Rule::one_of({"any", "native"}), ""},
            {"folded", "filter", &folded_.filter, filter, ""},
            {"folded", "sampling", &folded_.sampling_px, stride, ""},
            {"folded", "file", &folded_file_, {}, ""},
            {"folded", "sha256", &folded_.sha256, {}, ""}};
  }

  /// "<file>:<line>: <key>: <problem>"; the key of the entry, or of `folded`.
  [[nodiscard]] Error refuse(const std::string& key, const std::string& problem) const {
    constexpr std::string_view kFolded = "folded.";
    const YAML::Node node =
        key.starts_with(kFolded) ? node_["folded"][key.substr(kFolded.size())] : node_[key];
    return fail(fmt::format("{}:{}: {}: {}", source_.string(), line_of(node), key, problem));
  }

  Status read_keys() {
    std::vector<Field> keys = fields();
    if (Status status = config::read_document(node_, source_.string(), keys); !status) {
      return status;
    }
    has_folded_ = node_.IsMap() && node_["folded"].IsDefined();
    for (const Field& field : keys) {
      const bool is_optional = field.section.empty() ? field.key == "sampling" : !has_folded_;
      if (!is_optional && !field.is_given) {
        const YAML::Node group = field.section.empty() ? node_ : node_["folded"];
        return fail(
            fmt::format("{}:{}: missing key '{}'", source_.string(), line_of(group), field.name()));
      }
    }
    entry_.native_sampling_only = sampling_ == "native";
    return {};
  }

  /// Names beside the manifest, as absolute paths.
  Status set_files() {
    const auto check = [&](const std::string& group, const fs::path& name,
                           const std::string& sha256) -> Status {
      if (name.has_parent_path()) {
        return refuse(group + "file", fmt::format("expected a name beside the manifest, found '{}'",
                                                  name.string()));
      }
      if (sha256.size() != 64 || sha256.find_first_not_of("0123456789abcdef") != sha256.npos) {
        return refuse(group + "sha256", fmt::format("expected 64 digits 0-9 and a-f, found {} "
                                                    "characters",
                                                    sha256.size()));
      }
      return {};
    };
    const fs::path folder = fs::absolute(source_).parent_path();
    entry_.file = folder / file_;
    Status status = check("", file_, entry_.sha256);
    if (status && has_folded_) {
      folded_.file = folder / folded_file_;
      status = check("folded.", folded_file_, folded_.sha256);
      entry_.folded = folded_;
    }
    return status;
  }

  Status set_window() {
    const auto take = [&](const char* key, const std::vector<double>& numbers, auto& out) {
      const bool is_whole = std::all_of(numbers.begin(), numbers.end(),
                                        [](double number) { return number == std::floor(number); });
      if (numbers.size() != out.size() || !is_whole) {
        return Status(refuse(key, fmt::format("expected a list of {} whole numbers", out.size())));
      }
      std::transform(numbers.begin(), numbers.end(), out.begin(),
                     [](double number) { return static_cast<int>(number); });
      return Status();
    };
    Status status = take("kernel", kernel_, entry_.kernel_px);
    status = status ? take("padding", padding_, entry_.padding_px) : status;
    for (std::size_t side = 0; status && side < 4; ++side) {
      const int kernel = entry_.kernel_px.at(side % 2);
      // A window wholly in the padding would see nothing of the frame.
      if (entry_.padding_px.at(side) >= kernel) {
        return refuse("padding", fmt::format("expected less than the kernel ({}), found {}", kernel,
                                             entry_.padding_px.at(side)));
      }
    }
    return status;
  }

  [[nodiscard]] Status check_names() const {
    const std::string& name = entry_.name;
    if (is_hand_made(name) || name.ends_with(".onnx")) {
      return refuse("name", fmt::format("'{}' means something else in stem.model", name));
    }
    if (entry_.layer == "first") {
      return refuse("layer", "'first' means something else in stem.layer");
    }
    return {};
  }

  [[nodiscard]] Status check_filters() const {
    const auto check = [&](const char* key, int filter) -> Status {
      return filter < entry_.num_filters ? Status()
                                         : refuse(key, fmt::format("expected 0 to {}, found {}",
                                                                   entry_.num_filters - 1, filter));
    };
    Status status = check("default_filter", entry_.default_filter);
    if (status && has_folded_) {
      status = check("folded.filter", folded_.filter);
      if (status && entry_.stride_px % folded_.sampling_px != 0) {
        return refuse("folded.sampling",
                      fmt::format("expected a divisor of the stride {}, found {}", entry_.stride_px,
                                  folded_.sampling_px));
      }
    }
    return status;
  }

  /// Entries of one name are layers of one file.
  [[nodiscard]] Status check_against(const std::vector<ModelEntry>& others) const {
    for (const ModelEntry& other : others) {
      if (other.name != entry_.name) {
        continue;
      }
      if (other.layer == entry_.layer) {
        return refuse("name", fmt::format("'{}' with layer '{}' stands here twice", entry_.name,
                                          entry_.layer));
      }
      if (other.file != entry_.file || other.sha256 != entry_.sha256) {
        return refuse("file", fmt::format("expected {} with the same sha256 as the other layers of "
                                          "'{}', found {}",
                                          other.file.filename().string(), entry_.name, file_));
      }
    }
    return {};
  }

  const fs::path& source_;
  const YAML::Node node_;
  ModelEntry entry_;
  bool has_folded_ = false;
  // What the entry holds in another form.
  std::string file_;
  std::string folded_file_;
  std::string sampling_ = "any";
  std::vector<double> kernel_;
  std::vector<double> padding_;
  FoldedFilter folded_;
};

/// The list under the one key `models`.
Expected<YAML::Node> models_of(const fs::path& file, const std::string& text) {
  const auto root = config::parse_document(text, file.string());
  if (!root) {
    return root;
  }
  // size() counts a duplicated key twice, which is what we want here.
  const YAML::Node models = root->IsMap() ? (*root)["models"] : YAML::Node();
  if (!root->IsMap() || root->size() != 1 || !models.IsDefined()) {
    return fail(fmt::format("{}:{}: expected the one key 'models'", file.string(), line_of(*root)));
  }
  if (!models.IsSequence()) {
    return fail(
        fmt::format("{}:{}: models: expected a list of models", file.string(), line_of(models)));
  }
  return models;
}

}  // namespace

Expected<std::vector<ModelEntry>> load_manifest(const fs::path& file) {
  const auto models = read_text_file(file, kMaxSettings_MB).and_then([&](const std::string& text) {
    return models_of(file, text);
  });
  if (!models) {
    return models.error();
  }
  std::vector<ModelEntry> entries;
  for (const YAML::Node& node : *models) {
    Expected<ModelEntry> entry = EntryReader(file, node).read(entries);
    if (!entry) {
      return entry.error();
    }
    entries.push_back(*std::move(entry));
  }
  return entries;
}

}  // namespace stemvo
