// SPDX-License-Identifier: MIT
#include "pipeline/channel_images.hpp"

#include <string>
#include <vector>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "pipeline/out_folder.hpp"
#include "report/frame_image.hpp"
#include "stem/stem.hpp"

namespace stemvo {
Expected<std::size_t> write_channel_images(const ChannelImagesRequest& request,
                                           const RunProgress& progress) {
  if (const Status status = validate(request.config); !status) {
    return status.error();
  }
  FrameSourceRequest source = request;
  source.camera = request.config.input.camera;
  const auto sequence = open_source(source);
  if (!sequence) {
    return sequence.error();
  }
  const Expected<Stem> stem = Stem::load_all(request.config.stem);
  if (!stem) {
    return stem.error();
  }
  const Expected<FrameRange> filters =
      dataset::resolve_range(request.filters, static_cast<std::size_t>(stem->info().num_filters),
                             stem->info().model, "filters");
  if (!filters) {
    return filters.error();
  }
  const auto lock = pipeline::open_out_folder(
      request.out_dir, "channel", pipeline::input_files(request, *sequence, request.config));
  Status status = lock ? Status() : lock.error();
  std::size_t num_written = 0;
  const auto save = [&](const cv::Mat& image, std::size_t number, const std::string& name) {
    if (status) {
      ++num_written;
      status = write_image(request.out_dir / fmt::format("{:06}_{}.png", number, name), image);
    }
  };
  // Each filter keeps its own contrast limits.
  std::vector<ContrastNormalization> contrasts(filters->end - filters->begin,
                                               ContrastNormalization(request.config.stem));
  bool goes_on = true;
  for (std::size_t i = 0; i < sequence->size() && goes_on && status; ++i) {
    const std::size_t number = sequence->range().begin + i;
    const Expected<cv::Mat> frame = sequence->read(i);
    if (sequence->stream() && frame && frame->empty()) {
      break;
    }
    const auto channels =
        frame.and_then([&](const cv::Mat& pixels) { return stem->apply_all(pixels); });
    if (!channels) {
      return channels.error();
    }
    std::vector<cv::Mat> images;
    std::vector<std::string> captions = {fmt::format("input, frame {}", number)};
    save(*frame, number, "input");
    for (std::size_t k = filters->begin; k < filters->end; ++k) {
      images.push_back(contrasts[k - filters->begin].apply((*channels)[k]).pixels);
      captions.push_back(fmt::format("{} filter {}", request.config.stem.model, k));
      save(images.back(), number, fmt::format("filter_{:03}", k));
    }
    save(draw_channel_sheet(*frame, images, captions), number, "sheet");
    goes_on = !progress || progress(i + 1, sequence->size());
  }
  return status ? Expected<std::size_t>(num_written) : status.error();
}

}  // namespace stemvo
