// SPDX-License-Identifier: MIT
#include "stem/network_layer.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <mutex>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "try.hpp"

namespace stemvo::internal {
namespace {

/// Outputs computed at a time where a frame can be cut: what lies between a graph's operators then
/// stays in the cache (16 planes of 12 rows of a KITTI frame: 0.5 MB).
constexpr int kStripOutputs = 7680;

class NetworkLayer {
 public:
  NetworkLayer(std::string label, OnnxSession session, const SamplingPlan& plan, int num_threads)
      : label_(std::move(label)),
        session_(std::move(session)),
        plan_(plan),
        num_threads_(num_threads) {}

  [[nodiscard]] Expected<std::vector<Channel>> apply(const cv::Mat& frame, int first, int last) {
    STEMVO_TRY(check_size(frame.size()));
    const std::lock_guard lock(mutex_);
    fit_buffers(frame.size());
    fill_planes(frame);
    std::vector<Channel> channels(static_cast<std::size_t>(last - first));
    for (Channel& channel : channels) {
      channel.values.create(plan_.channel_size(frame.size()), CV_32F);
      channel.map = plan_.map();
    }
    STEMVO_TRY(run_passes(first, channels));
    return channels;
  }

 private:
  [[nodiscard]] Status check_size(cv::Size frame) const {
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

  /// One filter, one pass: its output is the channel.
  [[nodiscard]] bool is_written_in_place() const {
    return session_.num_filters() == 1 && plan_.num_passes() == 1;
  }
  /// One plane, no padding: some rows of the frame are a smaller frame.
  [[nodiscard]] bool can_be_cut() const {
    return session_.num_planes() == 1 && session_.fixed_size().height == 0 &&
           plan_.sees_windows_only && plan_.y.before + plan_.y.after == 0;
  }

  void fit_buffers(cv::Size frame) {
    if (frame == frame_) {
      return;
    }
    frame_ = frame;
    buffer_ = plan_.buffer_size(frame);
    pass_ = plan_.pass_size(frame);
    // A pass reads whole planes from its start on, so the last one reads past the last plane.
    const cv::Point last = plan_.shift(plan_.num_passes() - 1);
    const int slack_rows = last.y + last.x / buffer_.width + 1;
    planes_.create(session_.num_planes() * buffer_.height + slack_rows, buffer_.width);
    planes_.setTo(0);
    outputs_.assign(static_cast<std::size_t>(plan_.num_passes()), cv::Mat1f());
    if (!is_written_in_place()) {
      for (cv::Mat1f& output : outputs_) {
        output.create(session_.num_filters() * pass_.height, pass_.width);
      }
    }
  }

  /// The frame as float planes, R, G, B or gray, with their margins. Every pass reads these same
  /// planes from its own start: a shift costs no copy. Where a shifted row runs over into the next,
  /// no output that is kept looks.
  void fill_planes(const cv::Mat& frame) {
    cv::Mat source = frame;
    if (plan_.needs_margin()) {
      cv::copyMakeBorder(frame, bordered_, plan_.y.margin_before(), plan_.y.margin_after(),
                         plan_.x.margin_before(), plan_.x.margin_after(), cv::BORDER_REPLICATE);
      source = bordered_;
    }
    std::vector<cv::Mat> planes;
    for (int i = 0; i < session_.num_planes(); ++i) {
      planes.push_back(planes_.rowRange(i * buffer_.height, (i + 1) * buffer_.height));
    }
    if (frame.channels() == 1) {
      source.convertTo(planes[0], CV_32F);
      std::for_each(planes.begin() + 1, planes.end(),
                    [&](cv::Mat& plane) { planes[0].copyTo(plane); });
    } else if (planes.size() == 1) {
      source.convertTo(floats_, CV_32F);  // first: gray is not rounded
      cv::cvtColor(floats_, planes[0], cv::COLOR_RGB2GRAY);
    } else {
      cv::split(source, colours_.data());
      for (std::size_t i = 0; i < planes.size(); ++i) {
        colours_.at(i).convertTo(planes[i], CV_32F);
      }
    }
  }

  /// Passes side by side. Each is single-threaded and writes its own pixels of the channels, so the
  /// result does not depend on the number of threads.
  [[nodiscard]] Status run_passes(int first, std::vector<Channel>& channels) {
    std::vector<Status> done(static_cast<std::size_t>(plan_.num_passes()));
    cv::parallel_for_(
        cv::Range(0, plan_.num_passes()),
        [&](const cv::Range& range) {
          for (int i = range.start; i < range.end; ++i) {
            // One output buffer for the passes of a thread: it stays in the cache.
            cv::Mat1f& output = outputs_[static_cast<std::size_t>(range.start)];
            done[static_cast<std::size_t>(i)] = run_pass(i, first, output, channels);
          }
        },
        num_threads_ > 0 ? num_threads_ : cv::getNumThreads());
    const auto failed = std::find_if(done.begin(), done.end(), [](const Status& s) { return !s; });
    return failed == done.end() ? Status() : *failed;
  }

  [[nodiscard]] Status run_pass(int index,
                                int first,
                                cv::Mat1f& output,
                                std::vector<Channel>& channels) const {
    const cv::Point start = plan_.shift(index);
    const float* const image = planes_[start.y] + start.x;
    if (is_written_in_place()) {
      return run_in_place(image, channels.front().values);
    }
    STEMVO_TRY(session_.run(image, buffer_, output.ptr<float>(), pass_));
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const int top = (first + static_cast<int>(i)) * pass_.height;
      interleave(index, output.rowRange(top, top + pass_.height), channels[i].values);
    }
    return {};
  }

  /// The channel a few rows at a time, where it can be cut, from the rows of the image they see.
  [[nodiscard]] Status run_in_place(const float* image, cv::Mat1f channel) const {
    if (!can_be_cut()) {
      return session_.run(image, buffer_, channel.ptr<float>(), pass_);
    }
    const SamplingAxis& axis = plan_.y;
    const int strip_rows = std::max(1, kStripOutputs / channel.cols);
    for (int top = 0; top < channel.rows; top += strip_rows) {
      const int num_rows = std::min(strip_rows, channel.rows - top);
      const cv::Size rows_seen(buffer_.width, (num_rows - 1) * axis.stride + axis.kernel);
      const float* const start =
          image + static_cast<std::ptrdiff_t>(top) * axis.stride * buffer_.width;
      STEMVO_TRY(session_.run(start, rows_seen, channel[top], {channel.cols, num_rows}));
    }
    return {};
  }

  /// Writes the outputs of pass `index` to their pixels of the channel.
  void interleave(int index, const cv::Mat1f& pass, cv::Mat1f channel) const {
    const int step_x = plan_.x.num_shifts();
    const int step_y = plan_.y.num_shifts();
    for (int row = index / step_x, from = plan_.y.first_output(); row < channel.rows;
         row += step_y, ++from) {
      const float* source = pass[from] + plan_.x.first_output();
      float* const target = channel[row];
      for (int col = index % step_x; col < channel.cols; col += step_x) {
        target[col] = *source++;
      }
    }
  }

  std::string label_;
  OnnxSession session_;
  SamplingPlan plan_;
  int num_threads_;  ///< 0: all that OpenCV has

  // Buffers kept from frame to frame, of one call at a time.
  std::mutex mutex_;
  cv::Size frame_;    ///< that the sizes and buffers are for
  cv::Size buffer_;   ///< a plane
  cv::Size pass_;     ///< a channel of one pass
  cv::Mat1f planes_;  ///< one below the other, and the slack after them
  cv::Mat bordered_;  ///< the frame with its margin
  cv::Mat3f floats_;  ///< a colour frame for a graph that takes gray
  std::array<cv::Mat, 3> colours_;
  std::vector<cv::Mat1f> outputs_;  ///< all channels of one pass, one below the other
};

}  // namespace

FilterBank make_network_layer(const std::string& label,
                              OnnxSession session,
                              const SamplingPlan& plan,
                              int num_threads) {
  return
      [layer = std::make_shared<NetworkLayer>(label, std::move(session), plan, num_threads)](
          const cv::Mat& frame, int first, int last) { return layer->apply(frame, first, last); };
}

}  // namespace stemvo::internal
