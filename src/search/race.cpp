// SPDX-License-Identifier: MIT
#include "search/race.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "search/blocks.hpp"
#include "search/ranking.hpp"
#include "stem/enlargement.hpp"
#include "stemvo/check.hpp"
#include "stemvo/config.hpp"

namespace stemvo::search {
namespace {

using KeySet = std::set<FilterKey, KeyOrder>;

KeySet survivors_of(const std::vector<const Record*>& records, std::size_t count) {
  const std::vector<FilterKey> keys = choose_survivors(records, count);
  return {keys.begin(), keys.end()};
}

}  // namespace

Race::Race(const SearchPlan& plan,
           const SearchRequest& request,
           SearchProgress progress,
           RecordWriter writer,
           std::vector<Record> records,
           std::size_t most_kept)
    : plan_(plan),
      evaluation_(request.config.evaluation),
      block_size_(static_cast<std::size_t>(std::max(0, request.block))),
      most_kept_(most_kept),
      progress_(std::move(progress)),
      writer_(std::move(writer)) {
  for (Record& record : records) {
    frames_done_ += record.filter_frames + record.held_out_filter_frames;
    add_record(std::move(record));
  }
}

void Race::add_record(Record record) {
  record_of_[record.rung].try_emplace(record.key, records_.size());
  records_.push_back(std::move(record));
}

Status Race::run() {
  Block alive;
  Block baselines;
  for (std::size_t i = 0; i < plan_.candidates.size(); ++i) {
    (plan_.candidates[i].is_baseline ? baselines : alive).push_back(i);
  }
  for (std::size_t rung = 0; rung < plan_.identity.schedule.size() && !is_stopped_; ++rung) {
    if (rung > 0) {
      alive = survivors(alive, rung);
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

bool Race::is_last(std::size_t rung) const { return rung + 1 == plan_.identity.schedule.size(); }

/// Without what is repeated.
std::size_t Race::frames_planned() const {
  const Schedule& schedule = plan_.identity.schedule;
  std::size_t planned = 0;
  for (const PlanSequence& sequence : plan_.sequences) {
    const std::size_t num_frames = sequence.sequence.size();
    std::size_t racing = 0;
    for (const Candidate& candidate : plan_.candidates) {
      const bool runs = sequence.unusable[candidate.layer].empty();
      if (runs && (candidate.is_baseline || schedule.size() == 1)) {
        planned += num_frames;
      } else if (runs && !candidate.races && !sequence.is_held_out) {
        planned += frames_at(schedule.front(), num_frames);
      }
      racing += candidate.races && schedule.size() > 1 ? 1 : 0;
    }
    std::size_t before = 0;
    for (const Rung& rung : schedule) {
      const std::size_t frames = frames_at(rung, num_frames);
      const bool is_asked = !sequence.is_held_out || rung == schedule.back();
      planned += is_asked ? std::min(racing, rung.num_filters) * (frames - before) : 0;
      before = sequence.is_held_out ? 0 : frames;
    }
  }
  return std::max(planned, frames_done_);
}

const Record* Race::find(std::size_t candidate, std::size_t rung) const {
  const auto of_rung = record_of_.find(static_cast<int>(rung));
  if (of_rung == record_of_.end()) {
    return nullptr;
  }
  const auto found = of_rung->second.find(plan_.candidates[candidate].key);
  return found == of_rung->second.end() ? nullptr : &records_[found->second];
}

Race::Block Race::survivors(const Block& alive, std::size_t rung) {
  std::vector<const Record*> done;
  for (const std::size_t candidate : alive) {
    if (plan_.candidates[candidate].races) {
      done.push_back(find(candidate, rung - 1));
      STEMVO_CHECK(done.back() != nullptr, "a rung is complete before the next");
    }
  }
  const KeySet keys = survivors_of(done, plan_.identity.schedule[rung].num_filters);
  Block chosen;
  for (const std::size_t candidate : alive) {
    if (keys.contains(plan_.candidates[candidate].key)) {
      chosen.push_back(candidate);
    } else {
      kept_.erase(candidate);
    }
  }
  return chosen;
}

/// Those without a record, in blocks; those that go on apart from those that start, since a block
/// is at one frame.
Status Race::run_rung(std::size_t rung, const Block& alive) {
  Block going_on;
  Block starting;
  for (const std::size_t candidate : alive) {
    if (find(candidate, rung) == nullptr) {
      (kept_.count(candidate) > 0 ? going_on : starting).push_back(candidate);
    }
  }
  for (const Block& group : {going_on, starting}) {
    for (const Block& block : cut(group)) {
      if (is_stopped_) {
        return {};
      }
      if (Status status = run_block_of(rung, block); !status) {
        return status;
      }
    }
  }
  return {};
}

std::vector<Race::Block> Race::cut(const Block& group) const {
  std::vector<Flight> flights;
  for (const std::size_t candidate : group) {
    const std::size_t layer = plan_.candidates[candidate].layer;
    Flight& flight =
        flights.emplace_back(Flight{.layer = layer, .pass = plan_.layers[layer].pass, .bytes = 0});
    for (const PlanSequence& sequence : plan_.sequences) {
      const cv::Size channel = sequence.channels[layer];
      flight.bytes = std::max(flight.bytes, bytes_in_flight(channel, picture_size(layer, sequence),
                                                            plan_.sequences.size()));
    }
  }
  std::vector<Block> blocks = cut_into_blocks(flights, block_size_);
  for (Block& block : blocks) {
    for (std::size_t& index : block) {
      index = group[index];
    }
  }
  return blocks;
}

/// What the odometry of a layer works on.
cv::Size Race::picture_size(std::size_t layer, const PlanSequence& sequence) const {
  const PlanLayer& of = plan_.layers[layer];
  const Config chosen = with_chosen_upsample(of.config, sequence.sequence.camera().width_px);
  return sequence.channels[layer] * enlargement(chosen.stem.upsample, of.stem.info().sampling_px);
}

Status Race::run_block_of(std::size_t rung, const Block& block) {
  std::vector<Record> done(block.size());
  std::vector<Drives> drives(block.size());
  for (std::size_t i = 0; i < block.size(); ++i) {
    done[i].key = plan_.candidates[block[i]].key;
    done[i].rung = static_cast<int>(rung);
    if (auto kept = kept_.extract(block[i]); !kept.empty()) {
      drives[i] = std::move(kept.mapped());
    }
    drives[i].resize(plan_.sequences.size());
  }
  for (std::size_t s = 0; s < plan_.sequences.size(); ++s) {
    const bool is_asked = !plan_.sequences[s].is_held_out || is_last(rung);
    if (is_asked && (is_stopped_ || !run_sequence_of(rung, s, block, drives, done))) {
      return {};
    }
  }
  if (Status status = writer_.append(done); !status) {
    return status;
  }
  for (Record& record : done) {
    add_record(std::move(record));
  }
  if (!is_last(rung)) {
    keep(rung, block, std::move(drives));
  }
  return {};
}

/// Of those that ran this rung the best; those that have not run it yet are still to go on.
void Race::keep(std::size_t rung, const Block& block, std::vector<Drives> drives) {
  for (std::size_t i = 0; i < block.size(); ++i) {
    kept_.emplace(block[i], std::move(drives[i]));
  }
  if (kept_.size() <= most_kept_) {
    return;
  }
  std::vector<const Record*> done;
  for (const auto& [candidate, ignored] : kept_) {
    if (const Record* record = find(candidate, rung)) {
      done.push_back(record);
    }
  }
  const std::size_t num_waiting = kept_.size() - done.size();
  const KeySet best = survivors_of(done, most_kept_ - std::min(most_kept_, num_waiting));
  std::erase_if(kept_, [&](const auto& one) {
    return find(one.first, rung) != nullptr && !best.contains(plan_.candidates[one.first].key);
  });
}

bool Race::run_sequence_of(std::size_t rung,
                           std::size_t sequence_index,
                           const Block& block,
                           std::vector<Drives>& drives,
                           std::vector<Record>& records) {
  const PlanSequence& planned = plan_.sequences[sequence_index];
  const KittiSequence& sequence = planned.sequence;
  const std::size_t end = planned.is_held_out
                              ? sequence.size()
                              : frames_at(plan_.identity.schedule[rung], sequence.size());
  std::vector<BlockMember> members;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < block.size(); ++i) {
    const Candidate& candidate = plan_.candidates[block[i]];
    std::optional<FilterDrive>& drive = drives[i][sequence_index];
    if (!planned.unusable[candidate.layer].empty()) {
      continue;
    }
    if (!drive) {
      drive.emplace(make_drive(candidate, sequence.camera()));
    }
    begin = drive->num_frames();
    members.push_back({&candidate, &*drive});
  }
  const auto count = [this](std::size_t frames) {
    frames_done_ += frames;
    is_stopped_ = progress_ && !progress_(frames_done_, frames_planned());
    return !is_stopped_;
  };
  if (!run_block(plan_, sequence, members, begin, end, count, warnings_)) {
    return false;
  }
  for (std::size_t i = 0; i < block.size(); ++i) {
    add_score(planned, plan_.candidates[block[i]], drives[i][sequence_index], end - begin,
              records[i]);
  }
  return true;
}

FilterDrive Race::make_drive(const Candidate& candidate, const Camera& camera) const {
  const Config& config = plan_.layers[candidate.layer].config;
  Expected<ChannelOdometry> odometry = ChannelOdometry::create(config, camera);
  STEMVO_CHECK(odometry.has_value(), "the configuration was checked");
  return FilterDrive(std::move(*odometry), config.odometry.min_inliers);
}

void Race::add_score(const PlanSequence& planned,
                     const Candidate& candidate,
                     const std::optional<FilterDrive>& drive,
                     std::size_t num_frames,
                     Record& record) const {
  const KittiSequence& sequence = planned.sequence;
  DriveScore score = unusable_score(sequence.name(), planned.unusable[candidate.layer]);
  if (drive) {
    score = drive->score(sequence.name(), *sequence.ground_truth(), evaluation_);
    (planned.is_held_out ? record.held_out_filter_frames : record.filter_frames) += num_frames;
  }
  if (planned.is_held_out) {
    record.held_out = std::move(score);
  } else {
    record.drives.push_back(std::move(score));
  }
}

}  // namespace stemvo::search
