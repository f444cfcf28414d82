// SPDX-License-Identifier: MIT
#include "stemvo/stem/stem.hpp"

#include <numeric>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "stem/filter_layer.hpp"
#include "stem/model_file.hpp"
#include "stemvo/check.hpp"

namespace stemvo {

struct Stem::Impl {
  StemInfo info;
  std::unique_ptr<internal::FilterLayer> layer;   ///< all filters
  std::unique_ptr<internal::FilterLayer> folded;  ///< the one chosen alone; null: it has no file
};

namespace {

using internal::FilterLayer;

struct LoadedLayer {
  StemInfo info;
  std::unique_ptr<FilterLayer> layer;
  std::unique_ptr<FilterLayer> folded;
};

/// -1 stands for the default. Error: outside the layer.
Expected<int> choose_filter(const StemOptions& options, int num_filters, int default_filter) {
  const int filter = options.filter == -1 ? default_filter : options.filter;
  if (filter >= 0 && filter < num_filters) {
    return filter;
  }
  return fail(fmt::format(
      "stem.filter: expected 0 to {} for {}, found {}", num_filters - 1,
      options.layer == "first" ? options.model : options.model + " layer " + options.layer,
      filter));
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
Expected<int> choose_sampling(int asked, const ModelEntry& entry) {
  if (!entry.native_sampling_only) {
    return choose_sampling(asked, entry.stride_px);
  }
  if (asked == 0 || asked == entry.stride_px) {
    return entry.stride_px;
  }
  return fail(fmt::format(
      "stem.sampling_px: expected {} for layer {} of {}, which the manifest allows at its native "
      "stride only, found {}",
      entry.stride_px, entry.layer, entry.file.string(), asked));
}

/// Null where the filter, sampled like this, has no file of its own.
Expected<std::unique_ptr<FilterLayer>> load_folded(const ModelEntry& entry,
                                                   int filter,
                                                   int sampling) {
  const auto folded = internal::folded_entry(entry);
  if (!folded || entry.folded->filter != filter || entry.folded->sampling_px != sampling) {
    return nullptr;
  }
  auto session = internal::open_model(*folded);
  if (!session) {
    return session.error();
  }
  return internal::make_network_layer(folded->file.string(), *std::move(session),
                                      internal::SamplingPlan(*folded, sampling));
}

Expected<LoadedLayer> load_network(const StemOptions& options,
                                   const std::filesystem::path& models_dir) {
  const auto entry = internal::find_model(options.model, options.layer, models_dir);
  if (!entry) {
    return entry.error();
  }
  const auto sampling = choose_sampling(options.sampling_px, *entry);
  if (!sampling) {
    return sampling.error();
  }
  const auto filter = choose_filter(options, entry->num_filters, entry->default_filter);
  if (!filter) {
    return filter.error();
  }
  auto session = internal::open_model(*entry);
  if (!session) {
    return session.error();
  }
  auto folded = load_folded(*entry, *filter, *sampling);
  if (!folded) {
    return folded.error();
  }
  const internal::SamplingPlan plan(*entry, *sampling);
  if (plan.needs_margin() && !session->fixed_size().empty()) {
    return fail(fmt::format(
        "stem.sampling_px: expected {} for {}, which pads and takes frames of one size only, "
        "found {}",
        entry->stride_px, entry->file.string(), *sampling));
  }
  LoadedLayer loaded;
  loaded.info = {.model = options.model,
                 .layer = entry->layer,
                 .sha256 = entry->sha256,
                 .filter = *filter,
                 .num_filters = entry->num_filters,
                 .native_stride_px = entry->stride_px,
                 .sampling_px = *sampling};
  loaded.layer = internal::make_network_layer(entry->file.string(), *std::move(session), plan);
  loaded.folded = *std::move(folded);
  return loaded;
}

Expected<LoadedLayer> load_layer(const StemOptions& options,
                                 const std::filesystem::path& models_dir) {
  const bool is_gray = options.model == "gray";
  if (!is_gray && options.model != "input_layer") {
    return load_network(options, models_dir);
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
  const auto filter = choose_filter(options, loaded.info.num_filters, 0);
  if (!filter) {
    return filter.error();
  }
  loaded.info.filter = *filter;
  loaded.layer = is_gray ? internal::make_gray_layer() : internal::make_input_layer();
  return loaded;
}

}  // namespace

Stem::Stem(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Stem::Stem(Stem&&) noexcept = default;
Stem& Stem::operator=(Stem&&) noexcept = default;
Stem::~Stem() = default;

Expected<Stem> Stem::create(const StemOptions& options, const std::filesystem::path& models_dir) {
  auto loaded = load_layer(options, models_dir);
  if (!loaded) {
    return loaded.error();
  }
  auto impl = std::make_unique<Impl>();
  impl->info = std::move(loaded->info);
  impl->layer = std::move(loaded->layer);
  impl->folded = std::move(loaded->folded);
  return Stem(std::move(impl));
}

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
  return impl_->layer->apply(frame, 0, impl_->info.num_filters);
}

Expected<std::vector<Channel>> Stem::apply_range(const cv::Mat& frame, int first, int last) const {
  STEMVO_CHECK(frame.type() == CV_8UC1 || frame.type() == CV_8UC3, "a frame is 8 bit, gray or RGB");
  STEMVO_CHECK(0 <= first && first < last && last <= impl_->info.num_filters,
               "a range of filters lies inside the layer");
  return impl_->layer->apply(frame, first, last);
}

}  // namespace stemvo
