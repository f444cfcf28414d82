// SPDX-License-Identifier: MIT
#include "stem/stem.hpp"

#include <algorithm>
#include <initializer_list>
#include <numeric>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/imgproc.hpp>

#include "internal_check.hpp"
#include "stem/hand_made.hpp"
#include "stem/model_file.hpp"
#include "stem/network_layer.hpp"

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
Expected<int> choose_sampling(int asked, const StemNetwork& network) {
  const int stride = network.stride_px;
  if (network.native_sampling_only) {
    if (asked == 0 || asked == stride) {
      return stride;
    }
    return fail(fmt::format(
        "stem.sampling_px: expected {} for layer {} of {}, which the manifest allows at its native "
        "stride only, found {}",
        stride, network.layer, network.file.string(), asked));
  }
  if (asked == 0) {
    return std::gcd(stride, 2);
  }
  if (asked > 0 && stride % asked == 0) {
    return asked;
  }
  std::vector<int> allowed;
  for (int i = 1; i <= stride; ++i) {
    if (stride % i == 0) {
      allowed.push_back(i);
    }
  }
  return fail(fmt::format("stem.sampling_px: expected {} (divisors of the stride {}), found {}",
                          fmt::join(allowed, ", "), stride, asked));
}

/// What a manifest would refuse: numbers that no convolution has.
Status check_network(const StemNetwork& network) {
  using namespace internal;
  struct Number {
    const char* what;
    int min;
    int max;
    int found;
  };
  for (const auto& [what, min, max, found] : std::initializer_list<Number>{
           {"filters", 1, kMaxFilters, network.num_filters},
           {"kernel", 1, kMaxKernel_px, network.kernel_px[0]},
           {"kernel", 1, kMaxKernel_px, network.kernel_px[1]},
           {"stride", 1, kMaxStride_px, network.stride_px},
           {"padding", 0, kMaxKernel_px, *std::ranges::min_element(network.padding_px)},
           {"padding", 0, kMaxKernel_px, *std::ranges::max_element(network.padding_px)},
           {"default_filter", 0, kMaxFilters, network.default_filter},
           {"folded sampling", 1, kMaxStride_px,
            network.folded ? network.folded->sampling_px : 1}}) {
    if (found < min || found > max) {
      return fail(
          fmt::format("{}: {}: expected {} to {}, found {}", network.name, what, min, max, found));
    }
  }
  return {};
}

/// Error: a name of no layer of our own, without a network, or a network that is none.
Expected<StemNetwork> network_of(const StemOptions& options) {
  if (const auto bank = internal::hand_made_bank(options.model)) {
    if (options.layer != "first") {
      return fail(fmt::format("stem.layer: expected none for {}, found '{}'", options.model,
                              options.layer));
    }
    StemNetwork network;
    network.name = options.model;
    network.num_filters = bank->num_filters;
    network.stride_px = 1;
    return network;
  }
  if (options.network) {
    const Status status = check_network(*options.network);
    return status ? Expected<StemNetwork>(*options.network) : status.error();
  }
  if (options.model == "default") {
    return internal::built_in_network();
  }
  return fail(fmt::format(
      "stem.model: expected default, gray, input_layer, log, census or a network beside it, found "
      "'{}'",
      options.model));
}

struct OpenedBank {
  FilterBank bank;
  bool takes_any_size;
};

Expected<OpenedBank> open_bank(const StemNetwork& network, bool is_built_in, int sampling) {
  auto session =
      is_built_in ? internal::open_built_in_model(network) : internal::open_model(network);
  if (!session) {
    return session.error();
  }
  const std::string file = network.file.string();
  const internal::SamplingPlan plan(network, sampling);
  if (plan.needs_margin() && !session->fixed_size().empty()) {
    return fail(fmt::format(
        "stem.sampling_px: expected {} for {}, which pads and takes frames of one size only, "
        "found {}",
        network.stride_px, file, sampling));
  }
  const bool takes_any_size = session->fixed_size().empty() && !network.native_sampling_only;
  return OpenedBank{internal::make_network_layer(file, *std::move(session), plan), takes_any_size};
}

/// Pixel u of the frame is pixel zoom * (u + 0.5) - 0.5 of the enlarged one.
Expected<std::vector<Channel>> apply_enlarged(
    const FilterBank& bank, const cv::Mat& frame, int first, int last, int zoom) {
  if (zoom == 1) {
    return bank(frame, first, last);
  }
  cv::Mat enlarged;
  cv::resize(frame, enlarged, {}, zoom, zoom, cv::INTER_CUBIC);
  auto channels = bank(enlarged, first, last);
  if (!channels) {
    return fail(fmt::format("{} (a frame of {}x{} enlarged {} times)", channels.error().message,
                            frame.cols, frame.rows, zoom));
  }
  for (Channel& channel : *channels) {
    channel.map.scale /= zoom;
    channel.map.offset_px = ((channel.map.offset_px.array() + 0.5) / zoom - 0.5).matrix();
  }
  return channels;
}

void check_frame(const cv::Mat& frame) {
  STEMVO_CHECK(frame.type() == CV_8UC1 || frame.type() == CV_8UC3, "a frame is 8 bit, gray or RGB");
}

}  // namespace

Expected<Stem> Stem::load(const StemOptions& options, bool all_filters) {
  const auto network = network_of(options);
  if (!network) {
    return network.error();
  }
  const auto sampling = choose_sampling(options.sampling_px, *network);
  if (!sampling) {
    return sampling.error();
  }
  const std::string label =
      options.layer == "first" ? network->name : network->name + " layer " + options.layer;
  const auto filter =
      choose_filter(options.filter, label, network->num_filters, network->default_filter);
  if (!filter) {
    return filter.error();
  }
  StemInfo info = {.model = network->name,
                   .layer = network->layer,
                   .sha256 = network->sha256,
                   .filter = *filter,
                   .num_filters = network->num_filters,
                   .sampling_px = *sampling};
  if (auto hand_made = internal::hand_made_bank(options.model)) {
    return Stem(info, std::move(hand_made->bank), true);
  }
  const bool has_all = all_filters || !network->folded || network->folded->filter != *filter ||
                       network->folded->sampling_px != *sampling;
  auto bank = open_bank(has_all ? *network : internal::folded_network(*network), !options.network,
                        *sampling);
  if (!bank) {
    return bank.error();
  }
  info.takes_any_size = bank->takes_any_size;
  return Stem(info, std::move(bank->bank), has_all);
}

Expected<Stem> Stem::create(const StemOptions& options) { return load(options, false); }
Expected<Stem> Stem::create_all(const StemOptions& options) { return load(options, true); }

Expected<Channel> Stem::apply(const cv::Mat& frame, int zoom) const {
  check_frame(frame);
  const int index = has_all_ ? info_.filter : 0;
  auto channels = apply_enlarged(bank_, frame, index, index + 1, zoom);
  if (!channels) {
    return channels.error();
  }
  return std::move(channels->front());
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

}  // namespace stemvo
