// SPDX-License-Identifier: MIT
#include "stem/model.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "built_in_models.hpp"
#include "stem/network_layer.hpp"
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

using internal::SamplingAxis;
using internal::SamplingPlan;

// An output away from all borders, in the middle of a frame of this many strides and a kernel.
constexpr int kStrides = 6;
// Side of an image that all of a deep network's layers can take.
constexpr int kSmallest = 96;
// Share of the output's size: differences below it are rounding.
constexpr float kRounding = 1e-4F;

/// First output whose window lies in the frame, and one more: the frame goes on around it.
int probe_output(const SamplingAxis& axis) {
  return (axis.before + axis.stride - 1) / axis.stride + 1;
}

/// One less than whole strides: kernel and padding show in the number of outputs.
int probe_size(const SamplingAxis& axis, int fixed) {
  return fixed > 0 ? fixed : axis.kernel + axis.before + kStrides * axis.stride - 1;
}

/// A few strides wide, not whole ones; small, since a deep network is slow.
int small_size(const SamplingAxis& axis, int fixed) {
  return fixed > 0 ? fixed : std::max(kStrides * axis.stride, kSmallest) + axis.stride - 1;
}

bool differ(const std::vector<float>& a, const std::vector<float>& b) {
  float largest = 0.0F;
  for (const float value : a) {
    largest = std::max(largest, std::abs(value));
  }
  return !std::equal(a.begin(), a.end(), b.begin(),
                     [&](float x, float y) { return std::abs(x - y) <= kRounding * largest; });
}

/// Gray values without pattern; the other set differs from it at every pixel.
cv::Mat1f noise(cv::Size size, unsigned seed) {
  cv::Mat1f image(size);
  unsigned state = 12345U + seed;
  for (float& value : image) {
    state = state * 1664525U + 1013904223U;
    value = static_cast<float>(state >> 25U) + (seed == 0 ? 0.0F : 128.0F);
  }
  return image;
}

class GraphCheck {
 public:
  GraphCheck(const std::string& label, const OnnxSession& session, const ModelInfo& info)
      : session_(session), label_(label), plan_(info, info.stride_px) {}

  /// All that can be asked of a layer that is padded inside or sees the whole frame.
  [[nodiscard]] Status sizes() {
    const cv::Size fixed = session_.fixed_size();
    const cv::Size small(small_size(plan_.x, fixed.width), small_size(plan_.y, fixed.height));
    const cv::Size other = fixed.empty() ? small + cv::Size(1, plan_.y.stride) : small;
    return size(small).and_then([&] { return size(other); });
  }

  [[nodiscard]] Status window() {
    const cv::Size fixed = session_.fixed_size();
    STEMVO_TRY(size({probe_size(plan_.x, fixed.width), probe_size(plan_.y, fixed.height)}));
    output_ = {probe_output(plan_.x), probe_output(plan_.y)};
    window_ = {output_.x * plan_.x.stride - plan_.x.before,
               output_.y * plan_.y.stride - plan_.y.before, plan_.x.kernel, plan_.y.kernel};
    if ((window_ & cv::Rect({0, 0}, frame_)) != window_) {
      return {};  // a model of one size, too small to look inside
    }
    return dependence();
  }

 private:
  /// For a frame of this size, on which later checks run. Error: another one than the plan says.
  [[nodiscard]] Status size(cv::Size frame) {
    frame_ = frame;
    channel_ = plan_.channel_size(frame);
    STEMVO_TRY(run(noise(frame, 0)));
    return {};
  }

  /// All filters at the one output. Error: not finite somewhere.
  [[nodiscard]] Expected<std::vector<float>> run(const cv::Mat1f& image) const {
    std::vector<float> planes;
    for (int i = 0; i < session_.num_planes(); ++i) {
      planes.insert(planes.end(), image.begin(), image.end());
    }
    const auto area = static_cast<std::size_t>(channel_.area());
    std::vector<float> channels(area * static_cast<std::size_t>(session_.num_filters()));
    if (Status status = session_.run(planes.data(), frame_, channels.data(), channel_); !status) {
      return fail(fmt::format(
          "{} (expected channels of {}x{} for a frame of {}x{} by the model's "
          "kernel, stride and padding)",
          status.error().message, channel_.width, channel_.height, frame_.width, frame_.height));
    }
    if (!std::ranges::all_of(channels, [](float value) { return std::isfinite(value); })) {
      return fail(
          fmt::format("{}: expected finite channels of an image without pattern, found NaN "
                      "or infinity",
                      label_));
    }
    std::vector<float> values;
    for (auto i = static_cast<std::size_t>(output_.y * channel_.width + output_.x);
         i < channels.size(); i += area) {
      values.push_back(channels[i]);
    }
    return values;
  }

  /// That the output depends on all sides of its window, and on nothing outside.
  [[nodiscard]] Status dependence() const {
    const cv::Mat1f base = noise(frame_, 0);
    const cv::Mat1f other = noise(frame_, 1);
    STEMVO_TRY_GET(const auto expected, run(base));
    cv::Mat1f outside = other.clone();
    base(window_).copyTo(outside(window_));
    STEMVO_TRY_GET(const auto with_other_outside, run(outside));
    if (differ(expected, with_other_outside)) {
      return fail(
          fmt::format("{}: expected outputs that depend on the {}x{} window of the model's "
                      "kernel, stride and padding only, found that pixels outside it matter",
                      label_, window_.width, window_.height));
    }
    const cv::Rect& w = window_;
    for (const cv::Rect& edge : {cv::Rect(w.x, w.y, w.width, 1),
                                 {w.x, w.br().y - 1, w.width, 1},
                                 {w.x, w.y, 1, w.height},
                                 {w.br().x - 1, w.y, 1, w.height}}) {
      cv::Mat1f changed = base.clone();
      other(edge).copyTo(changed(edge));
      STEMVO_TRY_GET(const auto values, run(changed));
      if (!differ(expected, values)) {
        return fail(fmt::format(
            "{}: expected the {}x{} window of the model's kernel, stride and padding, found that "
            "the {}x{} pixels at {}, {} of it do not matter",
            label_, w.width, w.height, edge.width, edge.height, edge.x - w.x, edge.y - w.y));
      }
    }
    return {};
  }

  const OnnxSession& session_;
  const std::string& label_;
  SamplingPlan plan_;
  cv::Size frame_;
  cv::Size channel_;
  cv::Point output_;
  cv::Rect window_;  ///< of the output
};

/// Runs the graph on small images and holds its outputs against kernel, stride and padding; see
/// open_model. `label` is what messages call the file.
Status check_graph(const std::string& label, const OnnxSession& session, const ModelInfo& info) {
  GraphCheck check(label, session, info);
  return info.native_sampling_only ? check.sizes() : check.window();
}

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
