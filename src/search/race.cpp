// SPDX-License-Identifier: MIT
#include "search/race.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "internal_check.hpp"
#include "search/filter_drive.hpp"

namespace stemvo::search {
namespace {

using Candidates = std::vector<std::size_t>;  // ascending indices

/// One frame through all layers of a block.
struct BlockFrame {
  cv::Mat frame;  ///< empty: could not be read
  /// Channels of filters [first, last); none where the layer refused the frame.
  struct LayerChannels {
    int first = 0;
    int last = 0;
    std::vector<Channel> channels = {};
  };
  std::map<std::size_t, LayerChannels> layers;
};

struct Race {
  const SearchPlan& plan;
  const SearchProgress& progress;
  RecordWriter& writer;
  std::vector<FilterRecord>& records;
  std::size_t max_kept = 0;
  /// Of candidates in flight or kept, else empty: the odometry on each sequence; none where it has
  /// not started, or cannot.
  std::vector<std::vector<std::optional<FilterDrive>>> drives{plan.candidates.size()};
  std::map<std::pair<std::size_t, FilterKey>, std::size_t> record_of = {};  ///< by rung
  std::vector<std::string> warnings = {};
  std::size_t frames_done = 0;
  bool is_stopped = false;

  Status run() {
    for (std::size_t i = 0; i < records.size(); ++i) {
      frames_done += records[i].filter_frames + records[i].held_out_filter_frames;
      record_of.try_emplace({records[i].rung, records[i].key}, i);
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
      std::size_t last = is_baseline(i) ? rungs.size() - 1 : 0;
      if (plan.candidates[i].races) {  // so many go on, whoever that will be
        while (!is_last(last) && num_racing < rungs[last + 1].filters) {
          ++last;
        }
        ++num_racing;
      }
      for (const PlanSequence& sequence : plan.sequences) {
        planned += problem(i, sequence).empty() ? frames_to(last, sequence) : 0;
      }
    }
    return std::max(planned, frames_done);
  }

  const FilterRecord* find(std::size_t candidate, std::size_t rung) const {
    const auto found = record_of.find({rung, plan.candidates[candidate].key});
    return found == record_of.end() ? nullptr : &records[found->second];
  }

  /// Of candidates that ran the rung; the odometries of the others are given up.
  Candidates best_of(const Candidates& group, std::size_t rung, std::size_t count) {
    std::vector<const FilterRecord*> found;
    for (const std::size_t candidate : group) {
      found.push_back(find(candidate, rung));
      STEMVO_CHECK(found.back() != nullptr, "a rung is complete before the next");
    }
    Candidates best;
    for (const std::size_t index : choose_survivors(found, count)) {
      best.push_back(group[index]);
    }
    std::ranges::sort(best);
    for (const std::size_t candidate : group) {
      if (!std::ranges::binary_search(best, candidate)) {
        drives[candidate].clear();
      }
    }
    return best;
  }

  /// Keeps the best odometries of those that ran this rung, beside those that are still to run it.
  void limit_kept(std::size_t rung) {
    Candidates done;
    std::size_t num_waiting = 0;
    for (std::size_t i = 0; i < drives.size(); ++i) {
      if (!drives[i].empty() && find(i, rung) != nullptr) {
        done.push_back(i);
      } else if (!drives[i].empty()) {
        ++num_waiting;
      }
    }
    if (done.size() + num_waiting > max_kept) {
      best_of(done, rung, max_kept - std::min(max_kept, num_waiting));
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
      FilterRecord& record = done.emplace_back();
      record.key = plan.candidates[candidate].key;
      record.rung = rung;
      drives[candidate].resize(plan.sequences.size());
    }
    for (std::size_t i = 0; i < plan.sequences.size(); ++i) {
      const std::size_t end = frames_to(rung, plan.sequences[i]);
      if (end > 0 && !run_sequence(i, end, block, done)) {
        return {};
      }
    }
    for (const FilterRecord& record : done) {
      record_of.try_emplace({rung, record.key}, records.size());
      records.push_back(record);
    }
    for (const std::size_t candidate : block) {
      if (is_last(rung) || !plan.candidates[candidate].races) {
        drives[candidate].clear();
      }
    }
    limit_kept(rung);
    return writer.append(done);
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
      cannot.sequence = planned.sequence.name();
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
            process(running[static_cast<std::size_t>(task - 1)], sequence, now);
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
    const KittiSequence& sequence = plan.sequences[index].sequence;
    const Expected<cv::Mat> frame = sequence.read(frame_index);
    if (!frame) {
      warn(frame.error().message);
      return {};
    }
    BlockFrame read{*frame, {}};
    for (const std::size_t candidate : running) {
      const auto& [key, layer, races] = plan.candidates[candidate];
      const BlockFrame::LayerChannels part = {.first = key.filter};
      read.layers.try_emplace(layer, part).first->second.last = key.filter + 1;
    }
    for (auto& [layer, part] : read.layers) {
      auto channels = plan.layers[layer].stem.apply_range(*frame, part.first, part.last);
      if (channels) {
        part.channels = std::move(*channels);
      } else {
        warn(fmt::format("frame {}: {}", sequence.range().begin + frame_index,
                         channels.error().message));
      }
    }
    return read;
  }

  void process(std::size_t candidate, std::size_t sequence, const BlockFrame& read) {
    const auto found = read.layers.find(plan.candidates[candidate].layer);
    const Channel* channel = nullptr;
    if (found != read.layers.end() && !found->second.channels.empty()) {
      channel = &found->second.channels[static_cast<std::size_t>(
          plan.candidates[candidate].key.filter - found->second.first)];
    }
    drives[candidate][sequence]->process(channel, read.frame);
  }

  void warn(const std::string& text) {
    if (std::ranges::find(warnings, text) == warnings.end()) {
      warnings.push_back(text);
    }
  }
};

}  // namespace

std::vector<Candidates> cut_into_blocks(const SearchPlan& plan, const Candidates& candidates) {
  std::vector<Candidates> blocks;
  const PlanLayer* first = nullptr;  // of the last block
  for (const std::size_t candidate : candidates) {
    const PlanLayer& layer = plan.layers[plan.candidates[candidate].layer];
    const bool goes_on =
        first != nullptr && (plan.block > 0 || layer.pass == first->pass) &&
        blocks.back().size() < (plan.block > 0 ? plan.block : first->max_in_flight);
    if (!goes_on) {
      blocks.emplace_back();
      first = &layer;
    }
    blocks.back().push_back(candidate);
  }
  return blocks;
}

Expected<std::vector<std::string>> run_race(const SearchPlan& plan,
                                            const SearchProgress& progress,
                                            RecordWriter& writer,
                                            std::vector<FilterRecord>& records,
                                            std::size_t max_kept) {
  Race race{plan, progress, writer, records, max_kept};
  return race.run().map([&race] { return race.warnings; });
}

}  // namespace stemvo::search
