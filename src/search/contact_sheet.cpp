// SPDX-License-Identifier: MIT
#include "search/contact_sheet.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "search/ranking.hpp"
#include "search/tables.hpp"
#include "stemvo/dataset/sequence.hpp"
#include "stemvo/report/frame_picture.hpp"
#include "stemvo/report/trajectory_plot.hpp"

namespace stemvo::search {
namespace {

/// "t_rel 1.41 %", or "stopped after 25 frames".
std::string outcome_of(const FilterRow& row) {
  return row.status == FilterStatus::kStopped
             ? fmt::format("stopped after {} frames", row.drives.front().num_frames)
             : fmt::format("t_rel {:.2f} %", mean_score(row.drives).t_rel_percent.value_or(0.0));
}

std::string caption_of(const ShownFilter& shown) {
  return fmt::format("{}: {}, {}", shown.place, to_string(shown.row->key), outcome_of(*shown.row));
}

std::string legend_of(const ShownFilter& shown) {
  return shown.row->status == FilterStatus::kStopped
             ? fmt::format("{} ({})", shown.place, outcome_of(*shown.row))
             : shown.place;
}

Expected<KittiSequence> open_first(const Folders& folders, const SearchIdentity& identity) {
  const auto first =
      std::find_if(identity.sequences.begin(), identity.sequences.end(),
                   [](const SequenceIdentity& sequence) { return !sequence.is_held_out; });
  const Expected<Config> config = load_config(folders.out_dir / "config.yaml");
  if (!config) {
    return config.error();
  }
  return KittiSequence::open(
      first->directory,
      {.camera = config->input.camera,
       .frames = FrameRangeRequest{first->first_frame, first->first_frame + first->num_frames}});
}

Trajectory trajectory_of(const FilterRow& row) {
  Trajectory trajectory;
  for (const PathPoint& point : row.drives.front().path) {
    trajectory.emplace_back(Eigen::Quaterniond::Identity(),
                            Eigen::Vector3d(point.x_m, 0.0, point.z_m));
  }
  return trajectory;
}

Status write_trajectories(const std::filesystem::path& file,
                          const KittiSequence& sequence,
                          const std::vector<ShownFilter>& shown) {
  TrajectoryPlot plot;
  plot.title = fmt::format("{}, each step of its true length", sequence.name());
  plot.estimate = trajectory_of(*shown.front().row);
  plot.estimate_name = legend_of(shown.front());
  plot.ground_truth = sequence.ground_truth();
  for (std::size_t i = 1; i < shown.size(); ++i) {
    plot.others.push_back({legend_of(shown[i]), trajectory_of(*shown[i].row)});
  }
  return write_trajectory_png(file, plot);
}

Expected<cv::Mat> draw_channels(const Folders& folders,
                                const SearchIdentity& identity,
                                const KittiSequence& sequence,
                                const std::vector<ShownFilter>& shown) {
  const std::size_t middle = sequence.size() / 2;
  const Expected<cv::Mat> frame = sequence.read(middle);
  if (!frame) {
    return frame;
  }
  std::vector<cv::Mat> channels;
  std::vector<std::string> captions = {
      fmt::format("{}, frame {}", sequence.name(), sequence.range().begin + middle)};
  for (const ShownFilter& one : shown) {
    const Expected<Config> config = config_of(folders.out_dir, identity, one.row->key);
    if (!config) {
      return config.error();
    }
    const Expected<Stem> stem = Stem::create(config->stem, folders.models_dir);
    if (!stem) {
      return stem.error();
    }
    const Expected<Channel> channel = stem->apply(*frame);
    if (!channel) {
      return channel.error();
    }
    channels.push_back(channel->values);
    captions.push_back(caption_of(one));
  }
  return draw_channel_sheet(*frame, channels, captions);
}

}  // namespace

std::vector<ShownFilter> choose_rows(const SearchIdentity& identity, const SearchReport& report) {
  std::vector<const FilterRow*> rows;
  for (const FilterRow& row : report.rows) {
    if (row.status != FilterStatus::kNotDetected && !layer_of(identity, row.key).is_baseline) {
      rows.push_back(&row);
    }
  }
  std::vector<ShownFilter> shown;
  if (!rows.empty()) {
    shown.push_back({"best", rows.front()});
  }
  if (rows.size() > 2) {
    shown.push_back({"median", rows[rows.size() / 2]});
  }
  if (rows.size() > 1) {
    shown.push_back({"worst", rows.back()});
  }
  return shown;
}

Status write_contact_sheet(const Folders& folders,
                           const SearchIdentity& identity,
                           const SearchReport& report) {
  const std::vector<ShownFilter> shown = choose_rows(identity, report);
  if (shown.empty()) {
    return {};
  }
  const Expected<KittiSequence> sequence = open_first(folders, identity);
  if (!sequence) {
    return sequence.error();
  }
  const std::filesystem::path plot_file = folders.out_dir / "trajectories.png";
  if (const Status status = write_trajectories(plot_file, *sequence, shown); !status) {
    return status;
  }
  const Expected<cv::Mat> channels = draw_channels(folders, identity, *sequence, shown);
  if (!channels) {
    return channels.error();
  }
  cv::Mat plot = cv::imread(plot_file.string(), cv::IMREAD_COLOR);
  if (plot.empty()) {
    return fail(fmt::format("{}: cannot be read back", plot_file.string()));
  }
  cv::cvtColor(plot, plot, cv::COLOR_BGR2RGB);
  const double zoom = static_cast<double>(channels->cols) / plot.cols;
  cv::resize(plot, plot, {channels->cols, cvRound(zoom * plot.rows)}, 0, 0, cv::INTER_AREA);
  cv::Mat sheet;
  cv::vconcat(*channels, plot, sheet);
  return write_picture(folders.out_dir / "sheet.png", sheet);
}

}  // namespace stemvo::search
