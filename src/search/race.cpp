// SPDX-License-Identifier: MIT
#include "search/race.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "evaluation/metrics.hpp"
#include "geometry/degrees.hpp"
#include "internal_check.hpp"
#include "odometry/channel_odometry.hpp"

namespace stemvo::search {
namespace {

constexpr double kMinTracked = 0.5;
constexpr std::size_t kMaxPathPoints = 400;
constexpr std::size_t kMaxDense = 400;
constexpr double kDenseShare = 1.0 / 8.0;  // of the path, as robustness
/// Of the path so far; chosen among prefixes of clips (docs/search.md).
constexpr std::array<double, 3> kEarlyShares = {0.25, 0.5, 0.75};

/// Evenly spaced, first and last included, to the centimetre.
std::vector<std::array<double, 2>> path_of(std::span<const Rigid3> trajectory) {
  const std::size_t count = std::min(trajectory.size(), kMaxPathPoints);
  std::vector<std::array<double, 2>> path;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t index = count < 2 ? 0 : i * (trajectory.size() - 1) / (count - 1);
    const Eigen::Vector3d cm = (100.0 * trajectory[index].translation).array().round();
    path.push_back({cm.x() / 100.0, cm.z() / 100.0});
  }
  return path;
}

/// One filter's odometry over one sequence, and what is counted on the way.
class FilterDrive {
 public:
  /// The sequence, with ground truth, stays where it is.
  FilterDrive(const Config& config, const PlanSequence& planned)
      : odometry_(config, planned.sequence.camera()),
        config_(&config),
        sequence_(&planned.sequence),
        road_(&planned.road) {}

  [[nodiscard]] std::size_t num_frames() const { return odometry_.estimator().trajectory().size(); }

  /// Null: no image, or a stem that refused it.
  void process(const Channel* channel, const cv::Mat& frame) {
    const FrameResult result = odometry_.process(
        channel == nullptr ? PreparedFrame() : odometry_.prepare(*channel, frame));
    if (num_frames() <= 1) {
      return;
    }
    num_matches_ += static_cast<std::size_t>(result.num_matches);
    num_inliers_ += static_cast<std::size_t>(result.num_inliers);
    ++outcomes_[is_measured(result.state)                            ? kMeasured
                : result.state == FrameState::kNoImage               ? kNoImage
                : result.state == FrameState::kGated                 ? kGated
                : result.num_matches < config_->odometry.min_inliers ? kFewMatches
                                                                     : kFewInliers];
  }

  /// Of the frames so far, at least one.
  [[nodiscard]] DriveScore score() const {
    const auto num_steps = static_cast<double>(std::max<std::size_t>(num_frames(), 2) - 1);
    DriveScore score;
    score.sequence = sequence_->name();
    score.road = *road_;
    score.frames = num_frames();
    score.inliers = static_cast<double>(num_inliers_) / num_steps;
    score.tracked = static_cast<double>(outcomes_[kMeasured]) / num_steps;
    score.detected = num_frames() == 1 || *score.tracked >= kMinTracked;
    score.reason = score.detected ? "" : missing_reason();
    if (outcomes_[kMeasured] > 0) {  // else the numbers would be those of the zero-motion baseline
      add_errors(num_steps, score);
    }
    return score;
  }

 private:
  void add_errors(double num_steps, DriveScore& score) const {
    const auto truth = std::span(*sequence_->ground_truth()).first(num_frames());
    const Trajectory trajectory = rescale_steps(odometry_.estimator().trajectory(), truth);
    const Metrics metrics = evaluate(trajectory, truth, config_->evaluation);
    score.t_rel_percent = metrics.t_rel_percent;
    score.r_rel_deg_per_100m = metrics.r_rel_deg_per_100m;
    score.average_offset_m = metrics.average_offset_m;
    double translation_m = 0.0;
    double rotation_rad = 0.0;
    for (std::size_t i = 1; i < trajectory.size(); ++i) {
      const Rigid3 change = trajectory[i - 1].inverse() * trajectory[i];
      translation_m += change.translation.norm();
      rotation_rad += change.angle_rad();
    }
    score.E_t_m = translation_m / num_steps;
    score.E_r_deg = kDegPerRad * rotation_rad / num_steps;
    // A standing start has no segments: nothing is known against the filter.
    score.early_error_percent = dense_t_rel_percent(trajectory, truth, kEarlyShares).value_or(0.0);
    if (num_frames() == sequence_->size()) {
      add_dense_errors(trajectory, truth, kDenseShare * metrics.path_length_m, score);
    }
    score.path_xz_m = path_of(trajectory);
  }

  static void add_dense_errors(const Trajectory& trajectory,
                               std::span<const Rigid3> truth,
                               double length_m,
                               DriveScore& score) {
    const std::size_t step = (truth.size() + kMaxDense - 1) / kMaxDense;
    for (const SegmentError& one : segment_errors(trajectory, truth, {&length_m, 1}, step)) {
      score.dense_t_percent.push_back(std::round(1e4 * one.t_percent) / 1e4);
      score.block = std::max(score.block, (one.last - one.first + step - 1) / step);
    }
  }

  [[nodiscard]] std::string missing_reason() const {
    if (num_matches_ == 0 && outcomes_[kNoImage] < num_frames() - 1) {
      return "no matches: a channel without contrast";
    }
    constexpr std::array<const char*, kMeasured> kReasons = {"too few matches", "too few inliers",
                                                             "not a forward motion", "no image"};
    const auto most = std::max_element(outcomes_.begin(), outcomes_.begin() + kMeasured);
    return fmt::format("{} in {} of {} frames",
                       kReasons[static_cast<std::size_t>(most - outcomes_.begin())], *most,
                       num_frames() - 1);
  }

  ChannelOdometry odometry_;
  const Config* config_;
  const FrameSource* sequence_;
  const std::string* road_;
  // Of the frames after the first.
  std::size_t num_matches_ = 0;
  std::size_t num_inliers_ = 0;
  enum Outcome { kFewMatches, kFewInliers, kGated, kNoImage, kMeasured, kNumOutcomes };
  std::array<std::size_t, kNumOutcomes> outcomes_{};
};

using Candidates = std::vector<std::size_t>;  // ascending indices

/// One frame through all layers of a block.
struct BlockFrame {
  cv::Mat frame;                            ///< empty: could not be read
  std::map<std::size_t, Channel> channels;  ///< of candidates whose layer took the frame
};

struct Race {
  const SearchPlan& plan;
  const SearchProgress& progress;
  RecordFile& file;
  std::size_t max_kept = 0;
  /// Of candidates in flight or kept, else empty: the odometry on each sequence; none where it has
  /// not started, or cannot.
  std::vector<std::vector<std::optional<FilterDrive>>> drives{plan.candidates.size()};
  std::vector<std::string> warnings = {};
  std::size_t frames_done = 0;
  bool is_stopped = false;

  Status run() {
    for (const FilterRecord& record : file.records()) {
      frames_done += record.filter_frames + record.held_out_filter_frames;
    }
    Candidates alive;
    Candidates baselines;
    for (std::size_t i = 0; i < plan.candidates.size(); ++i) {
      (is_baseline(i) ? baselines : alive).push_back(i);
    }
    for (std::size_t rung = 0; rung < plan.identity.rungs.size() && !is_stopped; ++rung) {
      if (rung > 0) {
        std::erase_if(alive, [this](std::size_t one) { return !plan.candidates[one].races; });
        alive = best_of(alive, rung - 1, plan.identity.rungs[rung].filters);
      }
      if (is_last(rung)) {  // what filters are compared with runs all frames, outside the race
        alive.insert(alive.end(), baselines.begin(), baselines.end());
      }
      if (Status status = run_rung(rung, alive); !status) {
        return status;
      }
    }
    return {};
  }

  bool is_last(std::size_t rung) const { return rung + 1 == plan.identity.rungs.size(); }
  bool is_baseline(std::size_t candidate) const {
    return plan.identity.layers[plan.candidates[candidate].layer].baseline;
  }
  /// Why a candidate cannot be run on a sequence; empty: it can.
  const std::string& problem(std::size_t candidate, const PlanSequence& on) const {
    return on.problems[plan.candidates[candidate].layer];
  }
  /// Up to where a rung runs a sequence; 0: not at all.
  std::size_t frames_to(std::size_t rung, const PlanSequence& planned) const {
    return planned.is_held_out && !is_last(rung)
               ? 0
               : frames_at(plan.identity.rungs[rung], planned.sequence.size());
  }

  /// Without what is repeated.
  std::size_t frames_planned() const {
    const Schedule& rungs = plan.identity.rungs;
    std::size_t planned = 0;
    std::size_t num_racing = 0;
    for (std::size_t i = 0; i < plan.candidates.size(); ++i) {
      const bool races = plan.candidates[i].races;  // so many reach a rung, whoever that will be
      const auto reached =
          std::ranges::count_if(rungs, [&](auto& one) { return one.filters > num_racing; });
      const std::size_t last = is_baseline(i) ? rungs.size() - 1
                               : races        ? static_cast<std::size_t>(reached) - 1
                                              : 0;
      num_racing += races ? 1 : 0;
      for (const PlanSequence& sequence : plan.sequences) {
        planned += problem(i, sequence).empty() ? frames_to(last, sequence) : 0;
      }
    }
    return std::max(planned, frames_done);
  }

  const FilterRecord* find(std::size_t candidate, std::size_t rung) const {
    const auto found = file.records().find({rung, plan.candidates[candidate].key, {}, {}});
    return found == file.records().end() ? nullptr : &*found;
  }

  /// Of candidates that ran the rung; the odometries of the others are given up.
  Candidates best_of(const Candidates& group, std::size_t rung, std::size_t count) {
    std::vector<const FilterRecord*> found;
    for (const std::size_t candidate : group) {
      found.push_back(find(candidate, rung));
      STEMVO_CHECK(found.back() != nullptr, "a rung is complete before the next");
    }
    Candidates best;
    for (const std::size_t index : best_first(found)) {
      if (best.size() < count) {
        best.push_back(group[index]);
      } else {
        drives[group[index]].clear();
      }
    }
    std::ranges::sort(best);
    return best;
  }

  /// Keeps the best odometries of those that ran this rung, beside those that are still to run it.
  void limit_kept(std::size_t rung) {
    Candidates done;
    Candidates waiting;
    for (std::size_t i = 0; i < drives.size(); ++i) {
      if (!drives[i].empty()) {
        (find(i, rung) != nullptr ? done : waiting).push_back(i);
      }
    }
    if (done.size() + waiting.size() > max_kept) {
      best_of(done, rung, max_kept - std::min(max_kept, waiting.size()));
    }
  }

  /// Those without a record, in blocks; those that go on apart from those that start, since a block
  /// is at one frame.
  Status run_rung(std::size_t rung, const Candidates& alive) {
    Candidates going_on;
    Candidates starting;
    for (const std::size_t candidate : alive) {
      if (find(candidate, rung) == nullptr) {
        (drives[candidate].empty() ? starting : going_on).push_back(candidate);
      }
    }
    for (const Candidates& group : {going_on, starting}) {
      for (const Candidates& block : cut_into_blocks(plan, group)) {
        if (Status status = run_block(rung, block); !status || is_stopped) {
          return status;
        }
      }
    }
    return {};
  }

  Status run_block(std::size_t rung, const Candidates& block) {
    std::vector<FilterRecord> done;
    for (const std::size_t candidate : block) {
      done.push_back({rung, plan.candidates[candidate].key, {}, {}});
      drives[candidate].resize(plan.sequences.size());
    }
    for (std::size_t i = 0; i < plan.sequences.size(); ++i) {
      const std::size_t end = frames_to(rung, plan.sequences[i]);
      if (end > 0 && !run_sequence(i, end, block, done)) {
        return {};
      }
    }
    const Status written = file.append(done);
    for (const std::size_t candidate : block) {
      if (is_last(rung) || !plan.candidates[candidate].races) {
        drives[candidate].clear();
      }
    }
    limit_kept(rung);
    return written;
  }

  /// False: stopped before the last frame.
  bool run_sequence(std::size_t index,
                    std::size_t end,
                    const Candidates& block,
                    std::vector<FilterRecord>& done) {
    const PlanSequence& planned = plan.sequences[index];
    Candidates running;
    for (const std::size_t candidate : block) {
      std::optional<FilterDrive>& drive = drives[candidate][index];
      if (problem(candidate, planned).empty()) {
        running.push_back(candidate);
        if (!drive) {
          const Config& config = plan.layers[plan.candidates[candidate].layer].config;
          drive.emplace(config, planned);
        }
      }
    }
    const std::size_t begin = running.empty() ? end : drives[running.front()][index]->num_frames();
    STEMVO_CHECK(begin <= end, "odometries are kept at the frames of their last rung");
    if (begin < end && !run_frames(index, {begin, end}, running)) {
      return false;
    }
    for (std::size_t i = 0; i < block.size(); ++i) {
      const std::optional<FilterDrive>& drive = drives[block[i]][index];
      DriveScore cannot;
      cannot.sequence = planned.sequence.name();
      cannot.road = planned.road;
      cannot.reason = problem(block[i], planned);
      done[i].add(drive ? drive->score() : cannot, planned.is_held_out, drive ? end - begin : 0);
    }
    return true;
  }

  /// All are at the first of these frames. False: stopped before the last one.
  bool run_frames(std::size_t sequence, FrameRange frames, const Candidates& running) {
    BlockFrame now;
    BlockFrame next = read_frame(sequence, frames.begin, running);
    for (std::size_t i = frames.begin; i < frames.end; ++i) {
      now = std::exchange(next, {});
      const int num_tasks = static_cast<int>(running.size()) + 1;
      const auto run_tasks = [&](const cv::Range& tasks) {
        for (int task = tasks.start; task < tasks.end; ++task) {
          if (task > 0) {
            const std::size_t candidate = running[static_cast<std::size_t>(task - 1)];
            const auto found = now.channels.find(candidate);
            drives[candidate][sequence]->process(
                found == now.channels.end() ? nullptr : &found->second, now.frame);
          } else if (i + 1 < frames.end) {
            next = read_frame(sequence, i + 1, running);
          }
        }
      };
      cv::parallel_for_({0, num_tasks}, run_tasks, num_tasks);
      frames_done += running.size();
      is_stopped = progress && !progress(frames_done, frames_planned());
      if (is_stopped) {
        return false;
      }
    }
    return true;
  }

  BlockFrame read_frame(std::size_t index, std::size_t frame_index, const Candidates& running) {
    const FrameSource& sequence = plan.sequences[index].sequence;
    const Expected<cv::Mat> frame = sequence.read(frame_index);
    if (!frame) {
      warn(frame.error().message);
      return {};
    }
    BlockFrame read{*frame, {}};
    const auto layer_of = [this](std::size_t one) { return plan.candidates[one].layer; };
    for (std::size_t layer = 0; layer < plan.layers.size(); ++layer) {
      const auto group = std::ranges::equal_range(running, layer, {}, layer_of);
      if (group.empty()) {
        continue;
      }
      const int first = plan.candidates[group.front()].key.filter;
      const int last = plan.candidates[group.back()].key.filter;
      auto channels = plan.layers[layer].stem.apply_range(*frame, first, last + 1);
      if (!channels) {
        warn(fmt::format("frame {}: {}", sequence.range().begin + frame_index,
                         channels.error().message));
        continue;
      }
      for (const std::size_t one : group) {
        const int behind = plan.candidates[one].key.filter - first;
        read.channels[one] = std::move((*channels)[static_cast<std::size_t>(behind)]);
      }
    }
    return read;
  }

  void warn(const std::string& text) {
    if (std::ranges::find(warnings, text) == warnings.end()) {
      warnings.push_back(text);
    }
  }
};

}  // namespace

Expected<std::vector<std::string>> run_race(const SearchPlan& plan,
                                            const SearchProgress& progress,
                                            RecordFile& file,
                                            std::size_t max_kept) {
  Race race{plan, progress, file, max_kept};
  return race.run().map([&race] { return race.warnings; });
}

}  // namespace stemvo::search
