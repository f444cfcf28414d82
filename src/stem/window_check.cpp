// SPDX-License-Identifier: MIT
#include "stem/window_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace stemvo::internal {
namespace {

// An output away from all borders, in the middle of a frame of this many strides and a kernel.
constexpr int kStrides = 6;
// Side of a picture that all of a deep network's layers can take.
constexpr int kSmallest = 96;
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

cv::Rect window_of(const SamplingPlan& plan, cv::Point output) {
  return {output.x * plan.x.stride - plan.x.before, output.y * plan.y.stride - plan.y.before,
          plan.x.kernel, plan.y.kernel};
}

/// Runs the graph on small pictures and reads all filters at one output.
class Probe {
 public:
  Probe(const OnnxSession& session, cv::Size frame, cv::Size channel, cv::Point output)
      : session_(session), frame_(frame), channel_(channel), output_(output) {}

  [[nodiscard]] Expected<std::vector<float>> run(const cv::Mat1f& picture) const {
    std::vector<float> planes;
    for (int i = 0; i < session_.num_planes(); ++i) {
      planes.insert(planes.end(), picture.begin(), picture.end());
    }
    const auto area = static_cast<std::size_t>(channel_.area());
    std::vector<float> channels(area * static_cast<std::size_t>(session_.num_filters()));
    if (Status status = session_.run(planes.data(), frame_, channels.data(), channel_); !status) {
      return status.error();
    }
    std::vector<float> values;
    for (std::size_t i = 0; i < static_cast<std::size_t>(session_.num_filters()); ++i) {
      values.push_back(
          channels[i * area + static_cast<std::size_t>(output_.y * channel_.width + output_.x)]);
    }
    return values;
  }

 private:
  const OnnxSession& session_;
  cv::Size frame_;
  cv::Size channel_;
  cv::Point output_;
};

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
  cv::Mat1f picture(size);
  unsigned state = 12345U + seed;
  for (float& value : picture) {
    state = state * 1664525U + 1013904223U;
    value = static_cast<float>(state >> 25U) + (seed == 0 ? 0.0F : 128.0F);
  }
  return picture;
}

/// The second half of check_window.
Status check_dependence(const std::string& label,
                        const Probe& probe,
                        cv::Size frame,
                        cv::Rect window) {
  const cv::Mat1f base = noise(frame, 0);
  const cv::Mat1f other = noise(frame, 1);
  const auto expected = probe.run(base);
  cv::Mat1f outside = other.clone();
  base(window).copyTo(outside(window));
  const auto with_other_outside = probe.run(outside);
  if (!expected || !with_other_outside) {
    return expected ? with_other_outside.error() : expected.error();
  }
  if (differ(*expected, *with_other_outside)) {
    return fail(fmt::format(
        "{}: expected outputs that depend on the {}x{} window of the manifest's kernel, stride and "
        "padding only, found that pixels outside it matter",
        label, window.width, window.height));
  }
  const std::array<std::pair<std::string_view, cv::Rect>, 4> edges = {{
      {"first row", {window.x, window.y, window.width, 1}},
      {"last row", {window.x, window.br().y - 1, window.width, 1}},
      {"first column", {window.x, window.y, 1, window.height}},
      {"last column", {window.br().x - 1, window.y, 1, window.height}},
  }};
  for (const auto& [name, edge] : edges) {
    cv::Mat1f changed = base.clone();
    other(edge).copyTo(changed(edge));
    const auto values = probe.run(changed);
    if (!values) {
      return values.error();
    }
    if (!differ(*expected, *values)) {
      return fail(fmt::format(
          "{}: expected the {}x{} window of the manifest's kernel, stride and padding, found that "
          "its {} does not matter",
          label, window.width, window.height, name));
    }
  }
  return {};
}

/// Error: another one than the plan says.
Expected<cv::Size> channel_size_as_planned(const std::string& label,
                                           const OnnxSession& session,
                                           const SamplingPlan& native,
                                           cv::Size frame) {
  const auto found = session.channel_size(frame);
  if (!found) {
    return found;
  }
  if (const cv::Size expected = native.channel_size(frame); *found != expected) {
    return fail(fmt::format(
        "{}: expected channels of {}x{} for a frame of {}x{} by the manifest's kernel, stride and "
        "padding, found {}x{}",
        label, expected.width, expected.height, frame.width, frame.height, found->width,
        found->height));
  }
  return found;
}

/// A few strides wide, not whole ones; small, since a deep network is slow.
int small_size(const SamplingAxis& axis, int fixed) {
  return fixed > 0 ? fixed : std::max(kStrides * axis.stride, kSmallest) + axis.stride - 1;
}

}  // namespace

Status check_sizes(const std::string& label,
                   const OnnxSession& session,
                   const SamplingPlan& native) {
  const cv::Size small(small_size(native.x, session.fixed_size().width),
                       small_size(native.y, session.fixed_size().height));
  const cv::Size other =
      session.fixed_size().empty() ? small + cv::Size(1, native.y.stride) : small;
  for (const cv::Size frame : {small, other}) {
    if (const auto size = channel_size_as_planned(label, session, native, frame); !size) {
      return size.error();
    }
  }
  return {};
}

Status check_window(const std::string& label,
                    const OnnxSession& session,
                    const SamplingPlan& native) {
  const cv::Size frame(probe_size(native.x, session.fixed_size().width),
                       probe_size(native.y, session.fixed_size().height));
  const auto found = channel_size_as_planned(label, session, native, frame);
  if (!found) {
    return found.error();
  }
  const cv::Point output(probe_output(native.x), probe_output(native.y));
  const cv::Rect window = window_of(native, output);
  if ((window & cv::Rect({0, 0}, frame)) != window) {
    return {};  // a model of one size, too small to look inside
  }

  return check_dependence(label, Probe(session, frame, *found, output), frame, window);
}

}  // namespace stemvo::internal
