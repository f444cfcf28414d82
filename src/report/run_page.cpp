// SPDX-License-Identifier: MIT
#include "report/run_page.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace stemvo {
namespace {

using Json = nlohmann::ordered_json;

Json segments_json(const RunPage& run) {
  const auto& [truth, frames] = *run.ground_truth;
  Json lists = {
      {"length_m", Json::array()}, {"t_percent", Json::array()}, {"r_deg_per_100m", Json::array()}};
  for (const SegmentError& error :
       segment_errors({take_poses(run.plot.estimate, frames), truth},
                      run.report.metrics->segment_lengths_m, kFirstFrameStep)) {
    lists["length_m"].push_back(error.length_m);
    lists["t_percent"].push_back(error.t_percent);
    lists["r_deg_per_100m"].push_back(error.r_deg_per_100m);
  }
  return lists;
}

}  // namespace

void SmallFrames::add(std::size_t row, std::size_t number, const cv::Mat& image) {
  constexpr int kWidth_px = 320;
  if (row % step_ != 0 || image.empty()) {
    return;
  }
  images_.push_back({fmt::format("frame {}", number), encode_jpeg(image, kWidth_px), row});
  num_bytes_ += images_.back().jpeg.size();
  while (num_bytes_ > max_bytes_ && images_.size() > 1) {
    step_ *= 2;
    std::erase_if(images_, [this](const auto& kept) { return kept.row % step_ != 0; });
    num_bytes_ = 0;
    for (const html::CaptionedImage& kept : images_) {
      num_bytes_ += kept.jpeg.size();
    }
  }
}

Status write_run_page(const std::filesystem::path& file, const RunPage& run) {
  Json content = {{"page", "run"},
                  {"title", run.plot.title},
                  {"subtitle", run.plot.subtitle},
                  {"unit", run.plot.unit},
                  {"frames_csv", run.frames_csv},
                  {"metrics", metrics_document(run.report)},
                  {"numbers", format_metrics_table(run.report)},
                  {"stages", run.report.timing ? format_timing_table(*run.report.timing) : ""},
                  {"estimate", html::path_json(run.plot.estimate)},
                  {"map", Json()},
                  {"truth", Json()},
                  {"images", html::images_json(run.images)},
                  {"small_frames", html::images_json(run.small_frames)},
                  {"command", run.command},
                  {"configuration", run.config}};
  if (run.map) {
    content["map"] = html::path_json(run.map->path);
    content["map"]["loops"] = run.map->loops;
  }
  if (run.ground_truth) {
    content["truth"] = html::path_json(run.ground_truth->poses);
    content["truth"]["frames"] = run.ground_truth->frames;
    content["segments"] = segments_json(run);
  }
  return html::write_page(file, content);
}

}  // namespace stemvo
