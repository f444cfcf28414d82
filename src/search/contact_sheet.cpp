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

struct ShownFilter {
  const char* place;
  const FilterRow* row;
};

/// Best, median and worst; the same filter once.
std::vector<ShownFilter> choose_rows(const SearchReport& report) {
  const auto end = std::find_if(report.rows.begin(), report.rows.end(), [](const FilterRow& row) {
    return row.status != FilterStatus::kRanked;
  });
  const auto count = static_cast<std::size_t>(end - report.rows.begin());
  std::vector<ShownFilter> shown;
  if (count > 0) {
    shown.push_back({"best", &report.rows[0]});
  }
  if (count > 2) {
    shown.push_back({"median", &report.rows[count / 2]});
  }
  if (count > 1) {
    shown.push_back({"worst ranked", &report.rows[count - 1]});
  }
  return shown;
}

std::string caption_of(const ShownFilter& shown) {
  return fmt::format("{}: {}, t_rel {:.2f} %", shown.place, to_string(shown.row->key),
                     mean_score(shown.row->drives).t_rel_percent.value_or(0.0));
}

Expected<KittiSequence> open_first(const Folders& folders, const SearchIdentity& identity) {
  const auto first =
      std::find_if(identity.sequences.begin(), identity.sequences.end(),
                   [](const SequenceIdentity& sequence) { return !sequence.is_held_out; });
  const Expected<Config> config = load_config(folders.out_dir / "config.yaml");
  if (!config) {
    return tl::unexpected(config.error());
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
  plot.estimate_name = shown.front().place;
  plot.ground_truth = sequence.ground_truth();
  for (std::size_t i = 1; i < shown.size(); ++i) {
    plot.others.push_back({shown[i].place, trajectory_of(*shown[i].row)});
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
      return tl::unexpected(config.error());
    }
    const Expected<Stem> stem = Stem::create(config->stem, folders.models_dir);
    if (!stem) {
      return tl::unexpected(stem.error());
    }
    const Expected<Channel> channel = stem->apply(*frame);
    if (!channel) {
      return tl::unexpected(channel.error());
    }
    channels.push_back(channel->values);
    captions.push_back(caption_of(one));
  }
  return draw_channel_sheet(*frame, channels, captions);
}

}  // namespace

Status write_contact_sheet(const Folders& folders,
                           const SearchIdentity& identity,
                           const SearchReport& report) {
  const std::vector<ShownFilter> shown = choose_rows(report);
  if (shown.empty()) {
    return {};
  }
  const Expected<KittiSequence> sequence = open_first(folders, identity);
  if (!sequence) {
    return tl::unexpected(sequence.error());
  }
  const std::filesystem::path plot_file = folders.out_dir / "trajectories.png";
  if (const Status status = write_trajectories(plot_file, *sequence, shown); !status) {
    return status;
  }
  const Expected<cv::Mat> channels = draw_channels(folders, identity, *sequence, shown);
  if (!channels) {
    return tl::unexpected(channels.error());
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
