// SPDX-License-Identifier: MIT
#include "search/race.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "internal_check.hpp"
#include "search/filter_drive.hpp"

namespace stemvo::search {
namespace {

using Candidates = std::vector<std::size_t>;  // ascending indices

/// One frame through the layer of a block.
struct BlockFrame {
  cv::Mat frame;                  ///< empty: could not be read
  std::vector<Channel> channels;  ///< from the first filter's on; empty: the layer refused it
};

struct Race {
  const SearchPlan& plan;
  const SearchProgress& progress;
  RecordFile& file;
  std::size_t max_kept = 0;
  /// Odometries of candidates in flight or kept, one for each sequence, else empty; none where it
  /// has not started, or cannot.
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
  int filter_of(std::size_t candidate) const { return plan.candidates[candidate].key.filter; }
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

  /// If all filters can be run, and without what is repeated.
  std::size_t frames_planned() const {
    const Schedule& rungs = plan.identity.rungs;
    std::size_t planned = 0;
    for (const PlanSequence& sequence : plan.sequences) {
      std::size_t before = 0;
      for (std::size_t rung = 0; rung < rungs.size(); ++rung) {
        const std::size_t end = frames_to(rung, sequence);
        planned += rungs[rung].filters * (end - before);
        before = end;
      }
      planned += plan.identity.count(/*baselines=*/true) * before;
    }
    return std::max(planned, frames_done);
  }

  const FilterRecord* find(std::size_t candidate, std::size_t rung) const {
    const auto found = file.records().find({rung, plan.candidates[candidate].key, {}, {}});
    return found == file.records().end() ? nullptr : &*found;
  }

  /// Best candidates that ran the rung; the odometries of the others are given up.
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

  /// Keeps those of a block that go on, as far as there is room.
  void limit_kept(std::size_t rung, const Candidates& block) {
    auto num_kept = static_cast<std::size_t>(
        std::ranges::count_if(drives, [](auto& one) { return !one.empty(); }));
    for (const std::size_t candidate : block) {
      if (is_last(rung) || !plan.candidates[candidate].races || num_kept > max_kept) {
        drives[candidate].clear();
        --num_kept;
      }
    }
  }

  /// Candidates without a record, in blocks; those that go on apart from those that start, since a
  /// block is at one frame.
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
    limit_kept(rung, block);
    return file.append(done);
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
          drive.emplace(config, planned.sequence);
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
      cannot.sequence = planned.sequence.name;
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
            const auto behind =
                static_cast<std::size_t>(filter_of(candidate) - filter_of(running.front()));
            drives[candidate][sequence]->process(
                now.channels.empty() ? nullptr : &now.channels[behind], now.frame);
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
    const PlanLayer& layer = plan.layers[plan.candidates[running.front()].layer];
    auto channels =
        layer.stem.apply_range(*frame, filter_of(running.front()), filter_of(running.back()) + 1,
                               frame_zoom(layer, sequence.camera));
    if (!channels) {
      warn(fmt::format("frame {}: {}", sequence.range.begin + frame_index,
                       channels.error().message));
      return {*frame, {}};
    }
    return {*frame, *std::move(channels)};
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
