// SPDX-License-Identifier: MIT
#include "stem/model.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

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
// For typing errors.
constexpr int kMax = 4096;
constexpr int kMaxStride_px = 256;

std::string label_of(const std::string& model) {
  return model.ends_with(".onnx") ? model : model + " (built in)";
}

Expected<OnnxSession> open_session(const std::string& model) {
  return read_model(model).and_then(
      [&](const std::string& bytes) { return OnnxSession::create(label_of(model), bytes); });
}

/// The keys `stemvo.*` of a model's metadata. Error: of the first that is wrong.
Expected<ModelInfo> read_info(const std::string& label, const OnnxSession& session) {
  Status status;
  const auto value_of = [&](const std::string& key) {  // "": there is none
    return session.metadata("stemvo." + key).value_or("");
  };
  const auto text = [&](const std::string& key) {
    std::string value = value_of(key);
    if (status && value.empty()) {
      status = fail(
          fmt::format("{}: expected metadata stemvo.{}, found none; stemvo-lab export writes files "
                      "that have it",
                      label, key));
    }
    return value;
  };
  const auto numbers = [&](const std::string& key, std::span<int> out, int min, int max) {
    const std::string value = text(key);
    const auto found = parse_numbers(value, out.size());
    const auto is_good = [&](double number) {
      return number == std::floor(number) && number >= min && number <= max;
    };
    if (found && std::ranges::all_of(*found, is_good)) {
      std::ranges::copy(*found, out.begin());
    } else if (status) {
      status =
          fail(fmt::format("{}: stemvo.{}: expected {} whole numbers from {} to {}, found '{}'",
                           label, key, out.size(), min, max, one_line(value)));
    }
  };
  ModelInfo info;
  info.network = text("network");
  info.layer = text("layer");
  info.licence = text("licence");
  info.command = text("command");
  numbers("kernel", info.kernel_px, 1, kMax);
  numbers("stride", std::span(&info.stride_px, 1), 1, kMaxStride_px);
  // A window wholly in the padding would see nothing of the frame.
  numbers("padding", info.padding_px, 0, std::ranges::min(info.kernel_px) - 1);
  numbers("filters", std::span(&info.num_filters, 1), 1, kMax);
  numbers("default_filter", std::span(&info.default_filter, 1), 0, info.num_filters - 1);
  if (!value_of("filter").empty()) {
    numbers("filter", std::span(&info.only_filter.emplace(), 1), 0, info.num_filters - 1);
  }
  info.native_sampling_only = value_of("sampling") == "native";
  return status ? Expected<ModelInfo>(info) : status.error();
}

using internal::SamplingAxis;
using internal::SamplingPlan;

/// First output whose window lies in the frame, and one more: the frame goes on around it.
int probe_output(const SamplingAxis& axis) {
  return (axis.before + axis.stride - 1) / axis.stride + 1;
}

/// One less than whole strides: kernel and padding show in the number of outputs. Of a deep network
/// a size that all of its layers can take.
int probe_size(const SamplingAxis& axis, int fixed, bool is_deep) {
  constexpr int kStrides = 6;
  constexpr int kDeep = 96;
  const int size = std::max(axis.kernel + axis.before, is_deep ? kDeep : 0);
  return fixed > 0 ? fixed : size + kStrides * axis.stride - 1;
}

/// Gray values without pattern, black among them; those of another seed, 0 or 1, differ at every
/// pixel.
cv::Mat1f noise(cv::Size size, int seed) {
  cv::Mat1b image(size);
  cv::RNG(static_cast<unsigned>(seed) + 1U).fill(image, cv::RNG::UNIFORM, 8 * seed, 8 * seed + 8);
  cv::Mat1f values;
  image.convertTo(values, CV_32F, 16.0);
  return values;
}

/// Runs a graph on small images and holds its channels against kernel, stride and padding; see
/// open_model. `label` is what messages call the file.
class GraphCheck {
 public:
  GraphCheck(const std::string& label, const OnnxSession& session, const ModelInfo& info)
      : session_(session), label_(label), plan_(info, info.stride_px) {}

  [[nodiscard]] Status check() const {
    const bool is_deep = !plan_.sees_windows_only;
    const cv::Size fixed = session_.fixed_size();
    const cv::Size frame(probe_size(plan_.x, fixed.width, is_deep),
                         probe_size(plan_.y, fixed.height, is_deep));
    STEMVO_TRY(run(noise(frame, 0)));
    if (!is_deep) {
      return check_window(frame);
    }
    // All else that can be asked of a layer that is padded inside or sees the whole frame.
    const cv::Size other(frame.width + (fixed.width > 0 ? 0 : 1),
                         frame.height + (fixed.height > 0 ? 0 : 1));
    STEMVO_TRY(run(noise(other, 0)));
    return {};
  }

 private:
  /// The channels, one below the other. Errors: of another size than the plan says, not finite.
  [[nodiscard]] Expected<cv::Mat1f> run(const cv::Mat1f& image) const {
    const cv::Mat1f planes = cv::repeat(image, session_.num_planes(), 1);
    const cv::Size size = plan_.channel_size(image.size());
    cv::Mat1f channels(session_.num_filters() * size.height, size.width);
    const Status status =
        session_.run(planes.ptr<float>(), image.size(), channels.ptr<float>(), size);
    if (!status) {
      return fail(
          fmt::format("{} (expected channels of {}x{} for a frame of {}x{} by the model's "
                      "kernel, stride and padding)",
                      status.error().message, size.width, size.height, image.cols, image.rows));
    }
    return cv::checkRange(channels)
               ? Expected<cv::Mat1f>(channels)
               : fail(label_ + ": expected finite channels, found NaN or infinity");
  }

  /// That an output depends on all sides of its window, and on nothing outside.
  [[nodiscard]] Status check_window(cv::Size frame) const {
    const cv::Point output(probe_output(plan_.x), probe_output(plan_.y));
    const cv::Rect w(output.x * plan_.x.stride - plan_.x.before,
                     output.y * plan_.y.stride - plan_.y.before, plan_.x.kernel, plan_.y.kernel);
    if ((w & cv::Rect({0, 0}, frame)) != w) {
      return {};  // a model of one size, too small to look inside
    }
    const cv::Mat1f base = noise(frame, 0);
    const cv::Mat1f other = noise(frame, 1);
    STEMVO_TRY_GET(const auto expected, run(base));
    cv::Mat1f outside = other.clone();
    base(w).copyTo(outside(w));
    std::vector<cv::Mat1f> changed = {outside};
    for (const cv::Rect& edge : {cv::Rect(w.x, w.y, w.width, 1),
                                 {w.x, w.br().y - 1, w.width, 1},
                                 {w.x, w.y, 1, w.height},
                                 {w.br().x - 1, w.y, 1, w.height}}) {
      changed.push_back(base.clone());
      other(edge).copyTo(changed.back()(edge));
    }
    for (std::size_t i = 0; i < changed.size(); ++i) {
      STEMVO_TRY_GET(const auto found, run(changed[i]));
      if (differ(expected, found, output) == (i == 0)) {
        return fail(fmt::format(
            "{}: expected outputs that depend on the whole {}x{} window of the model's kernel, "
            "stride and padding, and on nothing else, found that pixels {} matter",
            label_, w.width, w.height, i == 0 ? "outside it" : "along one of its sides do not"));
      }
    }
    return {};
  }

  /// By more than rounding, in any filter at this output.
  [[nodiscard]] bool differ(const cv::Mat1f& a, const cv::Mat1f& b, const cv::Point& output) const {
    constexpr float kRounding = 1e-4F;
    float largest = 0.0F;
    float difference = 0.0F;
    for (int y = output.y; y < a.rows; y += a.rows / session_.num_filters()) {
      largest = std::max(largest, std::abs(a(y, output.x)));
      difference = std::max(difference, std::abs(a(y, output.x) - b(y, output.x)));
    }
    return difference > kRounding * largest;
  }

  const OnnxSession& session_;
  const std::string& label_;
  SamplingPlan plan_;
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
  return read_info(label_of(model), session);
}

Expected<internal::Model> internal::open_model(const std::string& model) {
  STEMVO_TRY_GET(auto session, open_session(model));
  const std::string label = label_of(model);
  STEMVO_TRY_GET(const auto info, read_info(label, session));
  const int expected = info.only_filter ? 1 : info.num_filters;
  if (session.num_filters() != expected) {
    return fail(
        fmt::format("{}: expected {} filters, found {}", label, expected, session.num_filters()));
  }
  STEMVO_TRY(GraphCheck(label, session, info).check());
  return Model{label, info, std::move(session)};
}

}  // namespace stemvo
