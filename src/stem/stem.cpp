// SPDX-License-Identifier: MIT
#include "stem/stem.hpp"

#include <map>
#include <numeric>
#include <optional>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "internal_check.hpp"
#include "stem/model.hpp"
#include "stem/network_layer.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

using internal::FilterBank;

/// -1 stands for the default. Error: outside the layer.
Expected<int> choose_filter(int asked, const std::string& of, int num_filters, int default_filter) {
  const int filter = asked == -1 ? default_filter : asked;
  if (filter >= 0 && filter < num_filters) {
    return filter;
  }
  return fail(
      fmt::format("stem.filter: expected 0 to {} for {}, found {}", num_filters - 1, of, filter));
}

/// 0 stands for every second pixel, where the stride allows it: a keypoint on a coarser channel is
/// worth too many pixels. Error: not a divisor, or a layer that allows its own stride only.
Expected<int> choose_sampling(int asked, int stride, bool native_only) {
  if (asked == 0) {
    return native_only ? stride : std::gcd(stride, 2);
  }
  if (native_only ? asked == stride : asked > 0 && stride % asked == 0) {
    return asked;
  }
  return fail(fmt::format("stem.sampling_px: expected the model's stride {}{}, found {}", stride,
                          native_only ? "" : " or a divisor of it", asked));
}

/// The default network's default filter has a file of its own, which takes a fraction of the time.
std::string choose_model(const StemOptions& options, bool all_filters) {
  constexpr int kFilter = 0;
  constexpr int kSampling_px = 2;
  const bool is_alone = (options.filter == -1 || options.filter == kFilter) &&
                        (options.sampling_px == 0 || options.sampling_px == kSampling_px);
  return options.model == "default" && is_alone && !all_filters ? "default_filter_0"
                                                                : options.model;
}

/// Pixel u of the frame is pixel zoom * (u + 0.5) - 0.5 of the enlarged one.
Expected<std::vector<Channel>> apply_enlarged(
    const FilterBank& bank, const cv::Mat& frame, int first, int last, int zoom) {
  if (zoom == 1) {
    return bank(frame, first, last);
  }
  cv::Mat enlarged;
  cv::resize(frame, enlarged, {}, zoom, zoom, cv::INTER_CUBIC);
  STEMVO_TRY_GET(auto channels, bank(enlarged, first, last));
  for (Channel& channel : channels) {
    channel.map.scale /= zoom;
    channel.map.offset_px = ((channel.map.offset_px.array() + 0.5) / zoom - 0.5).matrix();
  }
  return channels;
}

void check_frame(const cv::Mat& frame) {
  STEMVO_CHECK(frame.type() == CV_8UC1 || frame.type() == CV_8UC3, "a frame is 8 bit, gray or RGB");
}

/// 0.299 R + 0.587 G + 0.114 B, not rounded.
cv::Mat to_gray(const cv::Mat& frame) {
  cv::Mat values;
  frame.convertTo(values, CV_32F);  // first, so that gray is not rounded to 8 bit
  if (frame.channels() == 3) {
    cv::cvtColor(values.clone(), values, cv::COLOR_RGB2GRAY);
  }
  return values;
}

/// R, G, B as they are.
Expected<std::vector<Channel>> input_channels(const cv::Mat& frame, int first, int last) {
  std::vector<Channel> channels;
  for (int filter = first; filter < last; ++filter) {
    cv::Mat plane = frame;  // a gray frame has three equal colours
    if (frame.channels() == 3) {
      cv::extractChannel(frame, plane, filter);
    }
    plane.convertTo(channels.emplace_back().values, CV_32F);
  }
  return channels;
}

/// Laplacian of Gaussian at the size of what a tracker at half size resolves.
cv::Mat laplacian_of_gaussian(const cv::Mat& gray) {
  constexpr double kSigma_px = 2.0;
  cv::Mat smooth;
  cv::Mat values;
  cv::GaussianBlur(gray, smooth, {}, kSigma_px);
  cv::Laplacian(smooth, values, CV_32F);
  return values;
}

/// (gray - mean) / (standard deviation + floor) of the surroundings: what the census transform
/// compares, without its thresholds.
cv::Mat local_contrast(const cv::Mat& gray) {
  const cv::Size window(15, 15);
  constexpr double kFloor = 4.0;  // gray levels
  cv::Mat mean;
  cv::Mat square;
  cv::boxFilter(gray, mean, CV_32F, window);
  cv::boxFilter(gray.mul(gray), square, CV_32F, window);
  cv::Mat deviation = cv::max(square - mean.mul(mean), 0.0F);
  cv::sqrt(deviation, deviation);
  return (gray - mean) / (deviation + kFloor);
}

FilterBank of_gray(cv::Mat (*channel)(const cv::Mat& gray)) {
  return [channel](const cv::Mat& frame, int, int) -> Expected<std::vector<Channel>> {
    return std::vector<Channel>{{channel(to_gray(frame)), {}}};
  };
}

struct HandMadeBank {
  int num_filters = 1;
  FilterBank bank;
};

/// nullopt: not a name of one.
std::optional<HandMadeBank> hand_made_bank(const std::string& model) {
  static const std::map<std::string, HandMadeBank> kBanks = {
      {"gray", {1, of_gray([](const cv::Mat& gray) { return gray; })}},
      {"input_layer", {3, input_channels}},
      {"log", {1, of_gray(laplacian_of_gaussian)}},
      {"census", {1, of_gray(local_contrast)}}};
  const auto found = kBanks.find(model);
  return found != kBanks.end() ? std::optional(found->second) : std::nullopt;
}

}  // namespace

Expected<Stem> Stem::load(const StemOptions& options, int num_threads, bool all_filters) {
  if (auto hand_made = hand_made_bank(options.model)) {
    STEMVO_TRY_GET(const int filter,
                   choose_filter(options.filter, options.model, hand_made->num_filters, 0));
    STEMVO_TRY(choose_sampling(options.sampling_px, 1, /*native_only=*/false));
    return Stem({.model = options.model, .filter = filter, .num_filters = hand_made->num_filters},
                std::move(hand_made->bank), /*has_all=*/true);
  }
  STEMVO_TRY_GET(auto model, internal::open_model(choose_model(options, all_filters)));
  const ModelInfo& info = model.info;
  STEMVO_TRY_GET(const int filter, choose_filter(options.filter, options.model, info.num_filters,
                                                 info.default_filter));
  STEMVO_TRY_GET(const int sampling,
                 choose_sampling(options.sampling_px, info.stride_px, info.native_sampling_only));
  if (info.only_filter && (all_filters || filter != *info.only_filter)) {
    return fail(fmt::format("{}: expected a model of {}, found one of filter {} alone", model.label,
                            all_filters ? fmt::format("all {} filters", info.num_filters)
                                        : fmt::format("filter {}", filter),
                            *info.only_filter));
  }
  const internal::SamplingPlan plan(info, sampling);
  const bool has_one_size = !model.session.fixed_size().empty();
  if (plan.needs_margin() && has_one_size) {
    return fail(fmt::format(
        "stem.sampling_px: expected {} for {}, which pads and takes frames of one size only, "
        "found {}",
        info.stride_px, model.label, sampling));
  }
  return Stem(
      {.model = options.model,
       .layer = info.layer,
       .filter = filter,
       .num_filters = info.num_filters,
       .sampling_px = sampling,
       .takes_any_size = !has_one_size && !info.native_sampling_only},
      internal::make_network_layer(model.label, std::move(model.session), plan, num_threads),
      /*has_all=*/!info.only_filter);
}

Expected<Channel> Stem::apply(const cv::Mat& frame, int zoom) const {
  check_frame(frame);
  const int index = has_all_ ? info_.filter : 0;
  STEMVO_TRY_GET(auto channels, apply_enlarged(bank_, frame, index, index + 1, zoom));
  return std::move(channels.front());
}

Expected<std::vector<Channel>> Stem::apply_range(const cv::Mat& frame,
                                                 int first,
                                                 int last,
                                                 int zoom) const {
  check_frame(frame);
  STEMVO_CHECK(0 <= first && first < last && last <= info_.num_filters,
               "a range of filters lies inside the layer");
  STEMVO_CHECK(has_all_, "the stem was made with all filters");
  return apply_enlarged(bank_, frame, first, last, zoom);
}

bool is_hand_made(const std::string& model) { return hand_made_bank(model).has_value(); }

}  // namespace stemvo
