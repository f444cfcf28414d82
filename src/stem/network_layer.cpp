// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cstring>
#include <mutex>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "stem/filter_layer.hpp"

namespace stemvo::internal {
namespace {

/// Buffers kept from frame to frame.
struct Workspace {
  cv::Size frame;    ///< that the sizes below are for
  cv::Mat1f planes;  ///< planes of the buffer, one below the other, and the slack after them
  cv::Mat bordered;  ///< the frame with its margin
  cv::Mat3f floats;  ///< a colour frame for a graph that takes gray
  std::array<cv::Mat, 3> colours;
  std::vector<cv::Mat1f> outputs;  ///< all channels of one pass, one below the other
};

/// Outputs computed at a time where a frame can be cut: what lies between a graph's operators then
/// stays in the cache (16 planes of 12 rows of a KITTI frame: 0.5 MB).
constexpr int kStripOutputs = 7680;

class NetworkLayer final : public FilterLayer {
 public:
  NetworkLayer(std::string label, OnnxSession session, const SamplingPlan& plan)
      : label_(std::move(label)), session_(std::move(session)), plan_(plan) {}

  [[nodiscard]] Expected<std::vector<Channel>> apply(const cv::Mat& frame,
                                                     int first,
                                                     int last) const override {
    if (Status status = check_size(frame.size()); !status) {
      return status.error();
    }
    const std::lock_guard lock(mutex_);
    fill_planes(frame);
    std::vector<Channel> channels(static_cast<std::size_t>(last - first));
    for (Channel& channel : channels) {
      channel.values.create(plan_.channel_size(frame.size()), CV_32F);
      channel.map = plan_.map();
    }
    if (Status status = run_passes(first, channels); !status) {
      return status.error();
    }
    return channels;
  }

 private:
  [[nodiscard]] Status check_size(cv::Size frame) const;
  void fit_workspace(const cv::Mat& frame) const;
  void fill_planes(const cv::Mat& frame) const;
  [[nodiscard]] Status run_passes(int first, std::vector<Channel>& channels) const;
  [[nodiscard]] Status run_pass(int index,
                                int first,
                                cv::Mat1f& output,
                                std::vector<Channel>& channels) const;

  /// One filter, one pass: its output is the channel.
  [[nodiscard]] bool is_written_in_place() const {
    return session_.num_filters() == 1 && plan_.num_passes() == 1;
  }

  /// One plane, no padding: some rows of the frame are a smaller frame.
  [[nodiscard]] bool can_be_cut() const {
    return session_.num_planes() == 1 && session_.fixed_size().height == 0 &&
           plan_.sees_windows_only && plan_.y.before + plan_.y.after == 0;
  }
  [[nodiscard]] Status run_strips(const float* image, cv::Mat1f channel) const;

  std::string label_;
  OnnxSession session_;
  SamplingPlan plan_;
  mutable std::mutex mutex_;  ///< of the workspace
  mutable Workspace workspace_;
};

Status NetworkLayer::check_size(cv::Size frame) const {
  const cv::Size fixed = session_.fixed_size();
  if ((fixed.width > 0 && fixed.width != frame.width) ||
      (fixed.height > 0 && fixed.height != frame.height)) {
    return fail(fmt::format("{}: expected frames of {}x{}, the model's fixed size, found {}x{}",
                            label_, fixed.width, fixed.height, frame.width, frame.height));
  }
  if (plan_.channel_size(frame).empty()) {
    return fail(fmt::format("{}: expected frames of at least {}x{}, found {}x{}", label_,
                            plan_.x.kernel, plan_.y.kernel, frame.width, frame.height));
  }
  return {};
}

void NetworkLayer::fit_workspace(const cv::Mat& frame) const {
  if (workspace_.frame == frame.size()) {
    return;
  }
  const cv::Size buffer = plan_.buffer_size(frame.size());
  const cv::Size pass = plan_.pass_size(frame.size());
  // A pass reads whole planes from its start on, so the last one reads past the last plane.
  const cv::Point last = plan_.shift(plan_.num_passes() - 1);
  const int slack_rows = last.y + last.x / buffer.width + 1;
  workspace_.planes.create(session_.num_planes() * buffer.height + slack_rows, buffer.width);
  workspace_.planes.setTo(0);
  workspace_.outputs.assign(static_cast<std::size_t>(plan_.num_passes()), cv::Mat1f());
  for (cv::Mat1f& output : workspace_.outputs) {
    if (is_written_in_place()) {
      break;
    }
    output.create(session_.num_filters() * pass.height, pass.width);
  }
  workspace_.frame = frame.size();
}

/// The frame as float planes, R, G, B or gray, with their margins. Every pass reads these same
/// planes from its own start: a shift costs no copy. Where a shifted row runs over into the next,
/// no output that is kept looks.
void NetworkLayer::fill_planes(const cv::Mat& frame) const {
  fit_workspace(frame);
  const cv::Size buffer = plan_.buffer_size(frame.size());
  cv::Mat source = frame;
  if (plan_.needs_margin()) {
    cv::copyMakeBorder(frame, workspace_.bordered, plan_.y.margin_before(), plan_.y.margin_after(),
                       plan_.x.margin_before(), plan_.x.margin_after(), cv::BORDER_REPLICATE);
    source = workspace_.bordered;
  }
  std::vector<cv::Mat> planes;
  for (int i = 0; i < session_.num_planes(); ++i) {
    planes.push_back(workspace_.planes.rowRange(i * buffer.height, (i + 1) * buffer.height));
  }
  if (frame.channels() == 1) {
    source.convertTo(planes[0], CV_32F);
    for (std::size_t i = 1; i < planes.size(); ++i) {
      planes[0].copyTo(planes[i]);
    }
    return;
  }
  if (planes.size() == 1) {
    source.convertTo(workspace_.floats, CV_32F);  // first: gray is not rounded
    cv::cvtColor(workspace_.floats, planes[0], cv::COLOR_RGB2GRAY);
    return;
  }
  cv::split(source, workspace_.colours.data());
  for (std::size_t i = 0; i < 3; ++i) {
    workspace_.colours.at(i).convertTo(planes.at(i), CV_32F);
  }
}

/// Passes side by side. Each is single-threaded and writes its own places of the channels, so the
/// result does not depend on the number of threads.
Status NetworkLayer::run_passes(int first, std::vector<Channel>& channels) const {
  std::vector<Status> done(static_cast<std::size_t>(plan_.num_passes()));
  cv::parallel_for_(
      cv::Range(0, plan_.num_passes()),
      [&](const cv::Range& range) {
        for (int i = range.start; i < range.end; ++i) {
          // One output buffer for the passes of a thread: it stays in the cache.
          done[static_cast<std::size_t>(i)] = run_pass(
              i, first, workspace_.outputs[static_cast<std::size_t>(range.start)], channels);
        }
      },
      cv::getNumThreads());
  const auto failed = std::find_if(done.begin(), done.end(), [](const Status& s) { return !s; });
  return failed == done.end() ? Status() : *failed;
}

Status NetworkLayer::run_pass(int index,
                              int first,
                              cv::Mat1f& output,
                              std::vector<Channel>& channels) const {
  const cv::Size buffer = plan_.buffer_size(workspace_.frame);
  const cv::Size pass = plan_.pass_size(workspace_.frame);
  const cv::Point start = plan_.shift(index);
  const float* const image = workspace_.planes[start.y] + start.x;
  if (is_written_in_place() && can_be_cut()) {
    return run_strips(image, channels.front().values);
  }
  if (is_written_in_place()) {
    return session_.run(image, buffer, channels.front().values.ptr<float>(), pass);
  }
  if (Status status = session_.run(image, buffer, output.ptr<float>(), pass); !status) {
    return status;
  }
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const int top = (first + static_cast<int>(i)) * pass.height;
    cv::Mat1f values = channels[i].values;  // shares its pixels
    plan_.interleave(index, output.rowRange(top, top + pass.height), values);
  }
  return {};
}

/// The channel a few rows at a time, from the rows of the image that they see.
Status NetworkLayer::run_strips(const float* image, cv::Mat1f channel) const {
  const SamplingAxis& axis = plan_.y;
  const int width = plan_.buffer_size(workspace_.frame).width;
  const int strip_rows = std::max(1, kStripOutputs / channel.cols);
  for (int top = 0; top < channel.rows; top += strip_rows) {
    const int num_rows = std::min(strip_rows, channel.rows - top);
    const cv::Size rows_seen(width, (num_rows - 1) * axis.stride + axis.kernel);
    const float* const start = image + static_cast<std::ptrdiff_t>(top) * axis.stride * width;
    if (Status status = session_.run(start, rows_seen, channel[top], {channel.cols, num_rows});
        !status) {
      return status;
    }
  }
  return {};
}

}  // namespace

std::unique_ptr<FilterLayer> make_network_layer(std::string label,
                                                OnnxSession session,
                                                const SamplingPlan& plan) {
  return std::make_unique<NetworkLayer>(std::move(label), std::move(session), plan);
}

}  // namespace stemvo::internal
