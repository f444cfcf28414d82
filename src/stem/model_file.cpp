// SPDX-License-Identifier: MIT
#include "stem/model_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include "default_stem.hpp"
#include "internal_check.hpp"
#include "stem/network_layer.hpp"
#include "text/text_file.hpp"

namespace stemvo::internal {

namespace {

// An output away from all borders, in the middle of a frame of this many strides and a kernel.
constexpr int kStrides = 6;
// Side of an image that all of a deep network's layers can take.
constexpr int kSmallest = 96;
constexpr int kMaxModel_MB = 512;
// Of the output's size: differences below it are rounding.
constexpr float kRounding = 1e-4F;

/// First output whose window lies in the frame, and one more: the frame goes on around it.
int probe_output(const SamplingAxis& axis) {
  return (axis.before + axis.stride - 1) / axis.stride + 1;
}

int probe_size(const SamplingAxis& axis, int fixed) {
  if (fixed > 0) {
    return fixed;
  }
  // One less than whole strides: kernel and padding show in the number of outputs.
  int size = axis.kernel + axis.before + kStrides * axis.stride - 1;
  while (size < kSmallest) {  // the graph may compute deeper layers beside this one
    size += axis.stride;
  }
  return size;
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

/// Holds a graph against what its network says of it, by running it on small images.
class GraphCheck {
 public:
  GraphCheck(const OnnxSession& session, const StemNetwork& network)
      : session_(session), file_(network.file.string()), plan_(network, network.stride_px) {}

  /// All that can be asked of a layer that is padded inside or sees the whole frame.
  [[nodiscard]] Status sizes() {
    const cv::Size fixed = session_.fixed_size();
    const cv::Size small(small_size(plan_.x, fixed.width), small_size(plan_.y, fixed.height));
    const cv::Size other = fixed.empty() ? small + cv::Size(1, plan_.y.stride) : small;
    const Status status = size(small).and_then([&] { return size(other); });
    return status ? check_finite() : status;
  }

  [[nodiscard]] Status window() {
    const cv::Size fixed = session_.fixed_size();
    if (Status status = size({probe_size(plan_.x, fixed.width), probe_size(plan_.y, fixed.height)});
        !status) {
      return status;
    }
    output_ = {probe_output(plan_.x), probe_output(plan_.y)};
    window_ = {output_.x * plan_.x.stride - plan_.x.before,
               output_.y * plan_.y.stride - plan_.y.before, plan_.x.kernel, plan_.y.kernel};
    if ((window_ & cv::Rect({0, 0}, frame_)) != window_) {
      return check_finite();  // a model of one size, too small to look inside
    }
    return dependence();
  }

 private:
  /// For a frame of this size, on which later checks run. Error: another one than the plan says.
  [[nodiscard]] Status size(cv::Size frame) {
    const auto found = session_.channel_size(frame);
    if (!found) {
      return found.error();
    }
    frame_ = frame;
    channel_ = plan_.channel_size(frame);
    if (*found != channel_) {
      return fail(
          fmt::format("{}: expected channels of {}x{} for a frame of {}x{} by the manifest's "
                      "kernel, stride and padding, found {}x{}",
                      file_, channel_.width, channel_.height, frame.width, frame.height,
                      found->width, found->height));
    }
    return {};
  }

  [[nodiscard]] Status check_finite() const {
    const auto values = run(noise(frame_, 0));
    return values ? Status() : values.error();
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
      return status.error();
    }
    if (!std::ranges::all_of(channels, [](float value) { return std::isfinite(value); })) {
      return fail(
          fmt::format("{}: expected finite channels of an image without pattern, found NaN "
                      "or infinity",
                      file_));
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
    const auto expected = run(base);
    cv::Mat1f outside = other.clone();
    base(window_).copyTo(outside(window_));
    const auto with_other_outside = run(outside);
    if (!expected || !with_other_outside) {
      return (expected ? with_other_outside : expected).error();
    }
    if (differ(*expected, *with_other_outside)) {
      return fail(
          fmt::format("{}: expected outputs that depend on the {}x{} window of the manifest's "
                      "kernel, stride and padding only, found that pixels outside it matter",
                      file_, window_.width, window_.height));
    }
    const cv::Rect& w = window_;
    const std::array<std::pair<std::string_view, cv::Rect>, 4> edges = {{
        {"first row", {w.x, w.y, w.width, 1}},
        {"last row", {w.x, w.br().y - 1, w.width, 1}},
        {"first column", {w.x, w.y, 1, w.height}},
        {"last column", {w.br().x - 1, w.y, 1, w.height}},
    }};
    for (const auto& [name, edge] : edges) {
      cv::Mat1f changed = base.clone();
      other(edge).copyTo(changed(edge));
      const auto values = run(changed);
      if (!values) {
        return values.error();
      }
      if (!differ(*expected, *values)) {
        return fail(
            fmt::format("{}: expected the {}x{} window of the manifest's kernel, stride and "
                        "padding, found that its {} does not matter",
                        file_, w.width, w.height, name));
      }
    }
    return {};
  }

  const OnnxSession& session_;
  std::string file_;
  SamplingPlan plan_;
  cv::Size frame_;
  cv::Size channel_;
  cv::Point output_;
  cv::Rect window_;  ///< of the output
};

Expected<OnnxSession> load_model(const StemNetwork& network, std::string_view bytes) {
  const std::string file = network.file.string();
  if (!network.sha256.empty()) {
    if (const std::string hash = sha256_hex(bytes); hash != network.sha256) {
      return fail(fmt::format("{}: expected sha256 {}, found {}", file, network.sha256, hash));
    }
  }
  auto session = OnnxSession::create(file, bytes, network.layer);
  if (!session) {
    return session;
  }
  if (session->num_filters() != network.num_filters) {
    return fail(fmt::format("{}: expected {} filters, found {}", file, network.num_filters,
                            session->num_filters()));
  }
  GraphCheck check(*session, network);
  const Status status = network.native_sampling_only ? check.sizes() : check.window();
  return status ? std::move(session) : status.error();
}

}  // namespace

std::string sha256_hex(std::string_view bytes) { return Sha256({}).hex(bytes); }

Sha256::Sha256(std::string_view beginning) : state_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
  STEMVO_CHECK(EVP_DigestInit_ex(state_.get(), EVP_sha256(), nullptr) == 1 &&
                   EVP_DigestUpdate(state_.get(), beginning.data(), beginning.size()) == 1,
               "libcrypto begins a SHA-256");
}

std::string Sha256::hex(std::string_view rest) const {
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> state(EVP_MD_CTX_new(),
                                                                      &EVP_MD_CTX_free);
  std::array<unsigned char, 32> digest{};
  unsigned int size = 0;
  STEMVO_CHECK(EVP_MD_CTX_copy_ex(state.get(), state_.get()) == 1 &&
                   EVP_DigestUpdate(state.get(), rest.data(), rest.size()) == 1 &&
                   EVP_DigestFinal_ex(state.get(), digest.data(), &size) == 1 &&
                   size == digest.size(),
               "libcrypto computes a SHA-256");
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

/// As models/manifest.yaml says.
StemNetwork built_in_network() {
  StemNetwork network;
  network.name = "default";
  network.file = "default.onnx (built in)";
  network.layer = "stem";
  network.num_filters = 16;
  network.kernel_px = {8, 8};
  network.stride_px = 2;
  network.padding_px = {3, 3, 3, 3};
  network.default_filter = 2;
  network.folded = {2, 2, "default_filter_2.onnx (built in)", ""};
  return network;
}

StemNetwork folded_network(const StemNetwork& network) {
  StemNetwork folded = network;
  folded.file = network.folded->file;
  folded.sha256 = network.folded->sha256;
  folded.num_filters = 1;
  folded.default_filter = 0;
  folded.stride_px = network.folded->sampling_px;
  folded.folded.reset();
  return folded;
}

Expected<OnnxSession> open_model(const StemNetwork& network) {
  return read_text_file(network.file, kMaxModel_MB).and_then([&](const std::string& bytes) {
    return load_model(network, bytes);
  });
}

Expected<OnnxSession> open_built_in_model(const StemNetwork& network) {
  const auto text_of = [](const auto& bytes) {
    return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  return load_model(network, network.folded ? text_of(kDefaultOnnx) : text_of(kDefaultFilterOnnx));
}

}  // namespace stemvo::internal
