// SPDX-License-Identifier: MIT
#include "stem/stem.hpp"

#include <algorithm>
#include <initializer_list>
#include <numeric>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "internal_check.hpp"
#include "stem/filter_layer.hpp"
#include "stem/model_file.hpp"

namespace stemvo {

namespace {

using internal::FilterLayer;

struct LoadedLayer {
  StemInfo info;
  std::unique_ptr<FilterLayer> layer;   ///< all filters; null: not asked for
  std::unique_ptr<FilterLayer> folded;  ///< the one chosen alone; null: it has no file
};

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
/// worth too many pixels. Error: not a divisor.
Expected<int> choose_sampling(int asked, int stride) {
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

/// The same for a network's layer, which may allow its own stride only.
Expected<int> choose_sampling(int asked, const StemNetwork& network) {
  if (!network.native_sampling_only) {
    return choose_sampling(asked, network.stride_px);
  }
  if (asked == 0 || asked == network.stride_px) {
    return network.stride_px;
  }
  return fail(fmt::format(
      "stem.sampling_px: expected {} for layer {} of {}, which the manifest allows at its native "
      "stride only, found {}",
      network.stride_px, network.layer, network.file.string(), asked));
}

/// Null where the filter, sampled like this, has no file of its own.
Expected<std::unique_ptr<FilterLayer>> load_folded(const StemNetwork& network,
                                                   int filter,
                                                   int sampling) {
  const auto folded = internal::folded_network(network);
  if (!folded || network.folded->filter != filter || network.folded->sampling_px != sampling) {
    return nullptr;
  }
  auto session = internal::open_model(*folded);
  if (!session) {
    return session.error();
  }
  return internal::make_network_layer(folded->file.string(), *std::move(session),
                                      internal::SamplingPlan(*folded, sampling));
}

Expected<std::unique_ptr<FilterLayer>> load_all(const StemNetwork& network, int sampling) {
  auto session = internal::open_model(network);
  if (!session) {
    return session.error();
  }
  const internal::SamplingPlan plan(network, sampling);
  if (plan.needs_margin() && !session->fixed_size().empty()) {
    return fail(fmt::format(
        "stem.sampling_px: expected {} for {}, which pads and takes frames of one size only, "
        "found {}",
        network.stride_px, network.file.string(), sampling));
  }
  return internal::make_network_layer(network.file.string(), *std::move(session), plan);
}

/// What a manifest would refuse: numbers that no convolution has.
Status check_network(const StemNetwork& network) {
  constexpr int kMax = 4096;  // no product of sizes overflows
  const auto refuse = [&](const char* what, int min, int found) {
    return fail(
        fmt::format("{}: {}: expected {} to {}, found {}", network.name, what, min, kMax, found));
  };
  for (const auto& [what, min, found] : std::initializer_list<std::tuple<const char*, int, int>>{
           {"filters", 1, network.num_filters},
           {"kernel", 1, network.kernel_px[0]},
           {"kernel", 1, network.kernel_px[1]},
           {"stride", 1, network.stride_px},
           {"padding", 0, *std::ranges::min_element(network.padding_px)},
           {"padding", 0, *std::ranges::max_element(network.padding_px)},
           {"default_filter", 0, network.default_filter},
           {"folded sampling", 1, network.folded ? network.folded->sampling_px : 1}}) {
    if (found < min || found > kMax) {
      return refuse(what, min, found);
    }
  }
  return {};
}

/// Error: a name of no layer of our own, without a network, or a network that is none.
Expected<StemNetwork> network_of(const StemOptions& options) {
  if (options.network) {
    const Status status = check_network(*options.network);
    return status ? Expected<StemNetwork>(*options.network) : status.error();
  }
  if (options.model == "default") {
    return internal::built_in_network();
  }
  return fail(fmt::format(
      "stem.model: expected default, gray, input_layer or a network beside it, found '{}'",
      options.model));
}

Expected<LoadedLayer> load_network(const StemOptions& options, bool all_filters) {
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
  LoadedLayer loaded;
  loaded.info = {.model = network->name,
                 .layer = network->layer,
                 .sha256 = network->sha256,
                 .filter = *filter,
                 .num_filters = network->num_filters,
                 .native_stride_px = network->stride_px,
                 .sampling_px = *sampling};
  auto folded = load_folded(*network, *filter, *sampling);
  if (!folded) {
    return folded.error();
  }
  loaded.folded = *std::move(folded);
  if (loaded.folded == nullptr || all_filters) {
    auto layer = load_all(*network, *sampling);
    if (!layer) {
      return layer.error();
    }
    loaded.layer = *std::move(layer);
  }
  return loaded;
}

Expected<LoadedLayer> load_layer(const StemOptions& options, bool all_filters) {
  const bool is_gray = options.model == "gray";
  if (!is_gray && options.model != "input_layer") {
    return load_network(options, all_filters);
  }
  if (options.layer != "first") {
    return fail(
        fmt::format("stem.layer: expected none for {}, found '{}'", options.model, options.layer));
  }
  if (const auto sampling = choose_sampling(options.sampling_px, 1); !sampling) {
    return sampling.error();
  }
  LoadedLayer loaded;
  loaded.info.model = options.model;
  loaded.info.num_filters = is_gray ? 1 : 3;
  const auto filter = choose_filter(options.filter, options.model, loaded.info.num_filters, 0);
  if (!filter) {
    return filter.error();
  }
  loaded.info.filter = *filter;
  loaded.layer = is_gray ? internal::make_gray_layer() : internal::make_input_layer();
  return loaded;
}

}  // namespace

struct Stem::Impl : LoadedLayer {
  static Expected<Stem> load(const StemOptions& options, bool all_filters) {
    auto loaded = load_layer(options, all_filters);
    if (!loaded) {
      return loaded.error();
    }
    return Stem(std::make_unique<Impl>(*std::move(loaded)));
  }
};

Stem::Stem(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Stem::Stem(Stem&&) noexcept = default;
Stem& Stem::operator=(Stem&&) noexcept = default;
Stem::~Stem() = default;

Expected<Stem> Stem::create(const StemOptions& options) { return Impl::load(options, false); }
Expected<Stem> Stem::create_all(const StemOptions& options) { return Impl::load(options, true); }

const StemInfo& Stem::info() const { return impl_->info; }

Expected<Channel> Stem::apply(const cv::Mat& frame) const {
  STEMVO_CHECK(frame.type() == CV_8UC1 || frame.type() == CV_8UC3, "a frame is 8 bit, gray or RGB");
  auto channels = impl_->folded != nullptr
                      ? impl_->folded->apply(frame, 0, 1)
                      : impl_->layer->apply(frame, impl_->info.filter, impl_->info.filter + 1);
  if (!channels) {
    return channels.error();
  }
  return std::move(channels->front());
}

Expected<std::vector<Channel>> Stem::apply_all(const cv::Mat& frame) const {
  STEMVO_CHECK(frame.type() == CV_8UC1 || frame.type() == CV_8UC3, "a frame is 8 bit, gray or RGB");
  return apply_range(frame, 0, impl_->info.num_filters);
}

Expected<std::vector<Channel>> Stem::apply_range(const cv::Mat& frame, int first, int last) const {
  STEMVO_CHECK(frame.type() == CV_8UC1 || frame.type() == CV_8UC3, "a frame is 8 bit, gray or RGB");
  STEMVO_CHECK(0 <= first && first < last && last <= impl_->info.num_filters,
               "a range of filters lies inside the layer");
  STEMVO_CHECK(impl_->layer != nullptr, "the stem was made with all filters");
  return impl_->layer->apply(frame, first, last);
}

}  // namespace stemvo
