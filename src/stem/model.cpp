// SPDX-License-Identifier: MIT
#include "stem/model.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "built_in_models.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

using internal::OnnxSession;

constexpr int kMaxModel_MB = 512;
// For typing errors: a whole image's.
constexpr int kMaxKernel_px = 4096;
constexpr int kMaxStride_px = 256;
constexpr int kMaxFilters = 4096;

std::string label_of(const std::string& model) {
  return model.ends_with(".onnx") ? model : model + " (built in)";
}

Expected<OnnxSession> open_session(const std::string& model) {
  return read_model(model).and_then(
      [&](const std::string& bytes) { return OnnxSession::create(label_of(model), bytes); });
}

/// Reads the keys `stemvo.*` of a model's metadata, up to the first that is wrong.
class InfoReader {
 public:
  InfoReader(std::string label, const OnnxSession& session)
      : label_(std::move(label)), session_(session) {}

  Expected<ModelInfo> read() {
    ModelInfo info;
    info.network = text("network");
    info.layer = text("layer");
    info.licence = text("licence");
    info.command = text("command");
    numbers("kernel", info.kernel_px, 1, kMaxKernel_px);
    numbers("stride", std::span(&info.stride_px, 1), 1, kMaxStride_px);
    // A window wholly in the padding would see nothing of the frame.
    numbers("padding", info.padding_px, 0, std::ranges::min(info.kernel_px) - 1);
    numbers("filters", std::span(&info.num_filters, 1), 1, kMaxFilters);
    numbers("default_filter", std::span(&info.default_filter, 1), 0, info.num_filters - 1);
    if (has("filter")) {
      numbers("filter", std::span(&info.only_filter.emplace(), 1), 0, info.num_filters - 1);
    }
    info.native_sampling_only = has("sampling") && text("sampling") == "native";
    return status_ ? Expected<ModelInfo>(info) : status_.error();
  }

 private:
  [[nodiscard]] bool has(const char* key) const {
    const auto value = session_.metadata(fmt::format("stemvo.{}", key));
    return value && value->has_value();
  }

  std::string text(const char* key) {
    const auto value = session_.metadata(fmt::format("stemvo.{}", key));
    if (value && *value) {
      return **value;
    }
    if (status_) {
      status_ = value ? fail(fmt::format("{}: expected metadata stemvo.{}, found none; "
                                         "stemvo-lab export {} --layers NAME --preprocessing "
                                         "KIND --out FOLDER writes a file that has it",
                                         label_, key, label_))
                      : value.error();
    }
    return {};
  }

  void numbers(const char* key, std::span<int> out, int min, int max) {
    const std::string value = text(key);
    const auto found = parse_numbers(value, out.size());
    const auto is_good = [&](double number) {
      return number == std::floor(number) && number >= min && number <= max;
    };
    if (found && std::ranges::all_of(*found, is_good)) {
      std::ranges::copy(*found, out.begin());
    } else if (status_) {
      status_ =
          fail(fmt::format("{}: stemvo.{}: expected {} whole numbers from {} to {}, found "
                           "'{}'",
                           label_, key, out.size(), min, max, one_line(value)));
    }
  }

  const std::string label_;
  const OnnxSession& session_;
  Status status_;
};

}  // namespace

std::vector<std::string> built_in_models() {
  std::vector<std::string> names;
  for (const internal::BuiltInModel& model : internal::kBuiltInModels) {
    names.emplace_back(model.name);
  }
  return names;
}

Expected<std::string> read_model(const std::string& model) {
  if (model.ends_with(".onnx")) {
    return read_text_file(model, kMaxModel_MB);
  }
  for (const auto& [name, bytes] : internal::kBuiltInModels) {
    if (model == name) {
      return std::string(bytes);
    }
  }
  return fail(fmt::format(
      "stem.model: expected default, paper, gray, input_layer, log, census or the path of an "
      ".onnx, found '{}'",
      model));
}

Expected<ModelInfo> read_model_info(const std::string& model) {
  STEMVO_TRY_GET(const OnnxSession session, open_session(model));
  return InfoReader(label_of(model), session).read();
}

Expected<internal::Model> internal::open_model(const std::string& model) {
  STEMVO_TRY_GET(auto session, open_session(model));
  const std::string label = label_of(model);
  STEMVO_TRY_GET(const auto info, InfoReader(label, session).read());
  const int expected = info.only_filter ? 1 : info.num_filters;
  if (session.num_filters() != expected) {
    return fail(
        fmt::format("{}: expected {} filters, found {}", label, expected, session.num_filters()));
  }
  STEMVO_TRY(check_graph(label, session, info));
  return Model{label, info, std::move(session)};
}

}  // namespace stemvo
