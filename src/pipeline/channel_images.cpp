// SPDX-License-Identifier: MIT
#include "pipeline/channel_images.hpp"

#include <string>
#include <vector>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "pipeline/out_folder.hpp"
#include "report/frame_image.hpp"
#include "stem/stem.hpp"
#include "try.hpp"

namespace stemvo {
Expected<ChannelImagesReport> write_channel_images(const ChannelImagesRequest& request,
                                                   const RunProgress& progress) {
  STEMVO_TRY(validate(request.config));
  FrameSourceRequest source = request;
  source.camera = request.config.input.camera;
  STEMVO_TRY_GET(const auto sequence, open_source(source));
  STEMVO_TRY_GET(const Stem stem, Stem::load_all(request.config.stem));
  STEMVO_TRY_GET(
      const FrameRange filters,
      dataset::resolve_range(request.filters, static_cast<std::size_t>(stem.info().num_filters),
                             stem.info().model, "filters"));
  STEMVO_TRY_GET(const auto lock, pipeline::open_out_folder(
                                      request.out_dir, "channel",
                                      pipeline::input_files(request, sequence, request.config)));
  std::size_t num_written = 0;
  const auto save = [&](const cv::Mat& image, std::size_t number, const std::string& name) {
    ++num_written;
    return write_image(request.out_dir / fmt::format("{:06}_{}.png", number, name), image);
  };
  // Each filter keeps its own contrast limits.
  std::vector<ContrastNormalization> contrasts(filters.end - filters.begin,
                                               ContrastNormalization(request.config.stem));
  bool goes_on = true;
  for (std::size_t i = 0; i < sequence.size() && goes_on; ++i) {
    const std::size_t number = sequence.range.begin + i;
    STEMVO_TRY_GET(const cv::Mat frame, sequence.read(i));
    if (frame.empty()) {  // behind a stream's last
      break;
    }
    STEMVO_TRY_GET(const auto channels, stem.apply_all(frame));
    std::vector<cv::Mat> images = {frame};
    std::vector<std::string> captions = {fmt::format("input, frame {}", number)};
    STEMVO_TRY(save(frame, number, "input"));
    for (std::size_t k = filters.begin; k < filters.end; ++k) {
      images.push_back(contrasts[k - filters.begin].apply(channels[k]).pixels);
      captions.push_back(fmt::format("{} filter {}", request.config.stem.model, k));
      STEMVO_TRY(save(images.back(), number, fmt::format("filter_{:03}", k)));
    }
    STEMVO_TRY(save(draw_sheet(images, captions), number, "sheet"));
    goes_on = !progress || progress(i + 1, sequence.size());
  }
  return ChannelImagesReport{num_written, sequence.remarks()};
}

}  // namespace stemvo
