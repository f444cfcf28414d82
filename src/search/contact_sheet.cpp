// SPDX-License-Identifier: MIT
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "dataset/sequence.hpp"
#include "io/image_file.hpp"
#include "models/manifest.hpp"
#include "report/frame_image.hpp"
#include "report/trajectory_plot.hpp"
#include "search/records.hpp"
#include "stem/stem.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;

/// "t_rel 1.41 %", or "stopped after 25 frames".
std::string outcome_of(const FilterRow& row) {
  return row.status == FilterStatus::kStopped
             ? fmt::format("stopped after {} frames", row.drives.front().frames)
             : fmt::format("t_rel {:.2f} %", row.mean.t_rel_percent.value_or(0.0));
}

Status write_trajectories(const fs::path& file,
                          const KittiSequence& sequence,
                          const ShownFilters& shown) {
  TrajectoryPlot plot;
  plot.title = fmt::format("{}, each step of its true length", sequence.name());
  plot.ground_truth = sequence.ground_truth();
  for (const auto& [rank, row] : shown) {
    const bool is_stopped = row->status == FilterStatus::kStopped;
    plot.others.push_back({is_stopped ? fmt::format("{} ({})", rank, outcome_of(*row)) : rank, {}});
    for (const auto& [x_m, z_m] : row->drives.front().path_xz_m) {
      plot.others.back().trajectory.emplace_back(Eigen::Quaterniond::Identity(),
                                                 Eigen::Vector3d(x_m, 0.0, z_m));
    }
  }
  plot.estimate = plot.others.front().trajectory;
  plot.estimate_name = plot.others.front().name;
  plot.others.erase(plot.others.begin());
  return write_trajectory_png(file, plot);
}

Expected<cv::Mat> draw_channels(const Results& results,
                                const KittiSequence& sequence,
                                const ShownFilters& shown) {
  const std::size_t middle = sequence.size() / 2;
  const Expected<cv::Mat> frame = sequence.read(middle);
  if (!frame) {
    return frame;
  }
  std::vector<cv::Mat> channels;
  std::vector<std::string> captions = {
      fmt::format("{}, frame {}", sequence.name(), sequence.range().begin + middle)};
  for (const auto& [rank, row] : shown) {
    const LayerIdentity& layer = results.identity.layer_of(row->key);
    const Config config = config_of(results.config, layer, row->key.filter);
    const Expected<Channel> channel =
        create_stem(config.stem, results.models_dir).and_then([&](const Stem& s) {
          return s.apply(*frame);
        });
    if (!channel) {
      return channel.error();
    }
    channels.push_back(channel->values);
    captions.push_back(fmt::format("{}: {}, {}", rank, to_string(row->key), outcome_of(*row)));
  }
  return draw_channel_sheet(*frame, channels, captions);
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
    shown.emplace_back("best", rows.front());
  }
  if (rows.size() > 2) {
    shown.emplace_back("median", rows[rows.size() / 2]);
  }
  if (rows.size() > 1) {
    shown.emplace_back("worst", rows.back());
  }
  return shown;
}

Status write_contact_sheet(const Results& results, std::vector<std::string>& warnings) {
  const auto no_sheet = [&warnings](const Error& error) {
    warnings.push_back("no sheet.png: " + error.message);
    return Status();
  };
  const ShownFilters shown = choose_rows(results.identity, results.rows);
  if (shown.empty()) {
    return {};
  }
  const SequenceIdentity& first = results.identity.sequences.front();
  const Expected<KittiSequence> sequence = KittiSequence::open(
      first.directory, {.camera = results.config.input.camera,
                        .frames = FrameRangeRequest{first.first_frame, first.end_frame()}});
  if (!sequence) {
    return no_sheet(sequence.error());
  }
  const fs::path plot_file = results.out_dir / "trajectories.png";
  if (const Status status = write_trajectories(plot_file, *sequence, shown); !status) {
    return status;
  }
  const Expected<cv::Mat> channels = draw_channels(results, *sequence, shown);
  if (!channels) {
    return no_sheet(channels.error());
  }
  const Expected<cv::Mat> as_drawn = io::read_png(plot_file, true);
  if (!as_drawn) {
    return as_drawn.error();
  }
  cv::Mat plot = *as_drawn;
  const double zoom = static_cast<double>(channels->cols) / plot.cols;
  cv::resize(plot, plot, {channels->cols, cvRound(zoom * plot.rows)}, 0, 0, cv::INTER_AREA);
  cv::vconcat(*channels, plot, plot);
  return write_image(results.out_dir / "sheet.png", plot);
}

}  // namespace stemvo::search
