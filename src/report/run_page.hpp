// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "dataset/frame_source.hpp"
#include "evaluation/trajectory.hpp"
#include "html/page.hpp"
#include "report/frame_image.hpp"
#include "report/metrics_json.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Small images of a recording for its page: every tenth frame. Where they would take more than
/// `max_bytes`, every other one goes, until they fit: a page stays one that can be sent.
class SmallFrames {
 public:
  explicit SmallFrames(std::size_t max_bytes = 3'500'000) : max_bytes_(max_bytes) {}

  /// `row`: in frames.csv, rising; `number`: in the recording. An empty image is left out.
  void add(std::size_t row, std::size_t number, const cv::Mat& image);
  [[nodiscard]] const std::vector<html::CaptionedImage>& images() const { return images_; }

 private:
  std::size_t max_bytes_;
  std::size_t num_bytes_ = 0;
  std::size_t step_ = 10;  ///< rows from one to the next
  std::vector<html::CaptionedImage> images_;
};

struct MapPage {
  Trajectory path;  ///< of all frames, aligned as the estimate
  std::vector<std::pair<std::size_t, std::size_t>> loops;  ///< frames that show one place
};

/// A row and a pose per frame, in the world of the ground truth, which some frames may lack.
struct RunPage {
  const TrajectoryPlot& plot;  ///< its estimate after the alignment of report.metrics
  const MetricsReport& report;
  const std::string& frames_csv;
  const std::optional<MapPage>& map;  ///< nullopt: nothing is remembered
  const std::optional<GroundTruth>& ground_truth;
  const std::vector<html::CaptionedImage>& images;
  const std::vector<html::CaptionedImage>& small_frames;  ///< under the slider
  std::string config;                                     ///< YAML
  std::string command;                                    ///< that repeats the run; may be empty
};

[[nodiscard]] Status write_run_page(const std::filesystem::path& file, const RunPage& run);

}  // namespace stemvo
