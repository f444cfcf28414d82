// SPDX-License-Identifier: MIT
#include "pipeline/channel_pictures.hpp"

#include <string>
#include <vector>

#include <fmt/format.h>

#include "models/manifest.hpp"
#include "pipeline/out_folder.hpp"
#include "report/frame_image.hpp"

namespace stemvo {
namespace {

Expected<FrameRange> resolve_filters(const std::optional<FrameRangeRequest>& request,
                                     const StemInfo& info) {
  const auto num_filters = static_cast<std::size_t>(info.num_filters);
  const FrameRange range{request ? request->begin : 0,
                         request && request->end ? *request->end : num_filters};
  if (range.begin >= range.end || range.end > num_filters) {
    return fail(fmt::format("{}: expected filters inside 0:{}, found --filters {}:{}", info.model,
                            num_filters, range.begin, range.end));
  }
  return range;
}

/// Writes the pictures of one frame after the other; each filter keeps its own stretch.
class ChannelWriter {
 public:
  ChannelWriter(const ChannelPicturesRequest& request, const Stem& stem, FrameRange filters)
      : request_(request),
        stem_(stem),
        filters_(filters),
        stretches_(filters.end - filters.begin, ChannelStretch(request.config.stem)) {}

  Status write(const cv::Mat& frame, std::size_t number) {
    const Expected<std::vector<Channel>> channels = stem_.apply_all(frame);
    if (!channels) {
      return channels.error();
    }
    std::vector<cv::Mat> pictures;
    std::vector<std::string> captions = {fmt::format("input, frame {}", number)};
    Status status = save(frame, fmt::format("{:06}_input", number));
    for (std::size_t k = filters_.begin; status && k < filters_.end; ++k) {
      pictures.push_back(stretches_[k - filters_.begin].apply((*channels)[k]).pixels);
      captions.push_back(fmt::format("{} filter {}", request_.config.stem.model, k));
      status = save(pictures.back(), fmt::format("{:06}_filter_{:03}", number, k));
    }
    if (!status) {
      return status;
    }
    return save(draw_channel_sheet(frame, pictures, captions), fmt::format("{:06}_sheet", number));
  }

  [[nodiscard]] std::size_t num_written() const { return num_written_; }

 private:
  Status save(const cv::Mat& picture, const std::string& name) {
    ++num_written_;
    return write_image(request_.out_dir / (name + ".png"), picture);
  }

  const ChannelPicturesRequest& request_;
  const Stem& stem_;
  FrameRange filters_;
  std::vector<ChannelStretch> stretches_;
  std::size_t num_written_ = 0;
};

}  // namespace

Expected<std::size_t> write_channel_pictures(const ChannelPicturesRequest& request,
                                             const ChannelProgress& progress) {
  if (const Status status = validate(request.config); !status) {
    return status.error();
  }
  const auto opened = open_source({.path = request.sequence_dir,
                                   .kitti_camera = request.config.input.camera,
                                   .frames = request.frames,
                                   .camera_file = request.camera_file});
  if (!opened) {
    return opened.error();
  }
  const FrameSource& sequence = **opened;
  const Expected<Stem> stem = create_stem(request.config.stem, request.models_dir);
  if (!stem) {
    return stem.error();
  }
  const Expected<FrameRange> filters = resolve_filters(request.filters, stem->info());
  if (!filters) {
    return filters.error();
  }
  if (const Status status = pipeline::create_out_folder(request.out_dir); !status) {
    return status.error();
  }
  ChannelWriter writer(request, *stem, *filters);
  bool go_on = true;
  for (std::size_t i = 0; i < sequence.size() && go_on; ++i) {
    const Expected<cv::Mat> frame = sequence.read(i);
    if (!frame) {
      return frame.error();
    }
    if (const Status status = writer.write(*frame, sequence.range().begin + i); !status) {
      return status.error();
    }
    go_on = !progress || progress(i + 1, sequence.size());
  }
  return writer.num_written();
}

}  // namespace stemvo
