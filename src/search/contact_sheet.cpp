// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <fmt/format.h>

#include "dataset/frame_source.hpp"
#include "report/frame_image.hpp"
#include "search/records.hpp"
#include "stem/stem.hpp"

namespace stemvo::search {
namespace {

/// "t_rel 1.41 %", or "stopped after 25 frames".
std::string outcome_of(const FilterRow& row) {
  return row.status == FilterStatus::kStopped
             ? fmt::format("stopped after {} frames", row.drives.front().frames)
             : fmt::format("t_rel {:.2f} %", row.mean.t_rel_percent.value_or(0.0));
}

Expected<Pictures> draw_filters(const Results& results,
                                const FrameSource& sequence,
                                const ShownFilters& shown) {
  constexpr int kPageWidth_px = 720;
  const std::size_t middle = sequence.size() / 2;
  const Expected<cv::Mat> frame = sequence.read(middle);
  if (!frame) {
    return frame.error();
  }
  std::vector<cv::Mat> channels;
  std::vector<std::string> captions = {
      fmt::format("{}, frame {}", sequence.name, sequence.range.begin + middle)};
  for (const auto& [rank, row] : shown) {
    const LayerIdentity& layer = results.identity.layer_of(row->key);
    const Config config = config_of(results.config, layer, row->key.filter);
    const Expected<Channel> channel =
        Stem::load(config.stem).and_then([&](const Stem& stem) { return stem.apply(*frame); });
    if (!channel) {
      return channel.error();
    }
    channels.push_back(channel->values);
    captions.push_back(fmt::format("{}: {}, {}", rank, to_string(row->key), outcome_of(*row)));
  }
  Pictures pictures = {draw_channel_sheet(*frame, channels, captions), {}, sequence.ground_truth};
  for (const cv::Mat& image : draw_channels(*frame, channels, kPageWidth_px)) {
    pictures.channels.push_back(
        {captions[pictures.channels.size()], encode_jpeg(image, kPageWidth_px)});
  }
  return pictures;
}

}  // namespace

ShownFilters choose_rows(const SearchIdentity& identity, const std::vector<FilterRow>& all) {
  std::vector<const FilterRow*> rows;
  for (const FilterRow& row : all) {
    if (row.status != FilterStatus::kNotDetected && !identity.layer_of(row.key).baseline) {
      rows.push_back(&row);
    }
  }
  ShownFilters shown;
  if (!rows.empty()) {
    shown.emplace_back("best filter", rows.front());
  }
  if (rows.size() > 2) {
    shown.emplace_back("median", rows[rows.size() / 2]);
  }
  if (rows.size() > 1) {
    shown.emplace_back("worst", rows.back());
  }
  for (const FilterRow& row : all) {
    if (!shown.empty() && row.status != FilterStatus::kNotDetected &&
        identity.layer_of(row.key).baseline) {
      shown.emplace_back("baseline", &row);
    }
  }
  return shown;
}

Expected<Pictures> draw_pictures(const Results& results) {
  const ShownFilters shown = choose_rows(results.identity, results.rows);
  if (shown.empty()) {
    return Pictures();
  }
  const SequenceIdentity& first = results.identity.sequences.front();
  const Expected<FrameSource> sequence = open_kitti(
      first.directory, {.camera = results.config.input.camera,
                        .frames = FrameRangeRequest{first.first_frame, first.end_frame()}});
  if (!sequence) {
    return sequence.error();
  }
  return draw_filters(results, *sequence, shown);
}

}  // namespace stemvo::search
