// SPDX-License-Identifier: MIT
#include "search/block_runner.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "stemvo/check.hpp"

namespace stemvo::search {
namespace {

/// The filters of one layer that are in the block.
struct LayerUse {
  int first = 0;
  int last = 0;
};

/// One frame, seen through all layers of the block.
struct Sight {
  cv::Mat frame;                                         ///< empty: could not be read
  std::map<std::size_t, std::vector<Channel>> channels;  ///< none of a layer that refused the frame
  std::vector<std::string> problems;
};

class Block {
 public:
  Block(const SearchPlan& plan, const KittiSequence& sequence, std::span<const BlockMember> members)
      : plan_(plan), sequence_(sequence), members_(members) {
    for (const BlockMember& member : members) {
      const int filter = member.candidate->key.filter;
      const auto [place, is_new] =
          uses_.try_emplace(member.candidate->layer, LayerUse{filter, filter + 1});
      place->second.first = std::min(place->second.first, filter);
      place->second.last = std::max(place->second.last, filter + 1);
    }
  }

  [[nodiscard]] Sight look(std::size_t index) const {
    Sight sight;
    const Expected<cv::Mat> frame = sequence_.read(index);
    if (!frame) {
      sight.problems.push_back(frame.error().message);
      return sight;
    }
    sight.frame = *frame;
    for (const auto& [layer, use] : uses_) {
      auto channels = plan_.layers[layer].stem.apply_range(*frame, use.first, use.last);
      if (channels) {
        sight.channels.emplace(layer, std::move(*channels));
      } else {
        sight.problems.push_back(
            fmt::format("frame {}: {}", sequence_.range().begin + index, channels.error().message));
      }
    }
    return sight;
  }

  void process(std::size_t member, const Sight& sight) const {
    const Candidate& candidate = *members_[member].candidate;
    FilterDrive& drive = *members_[member].drive;
    const auto channels = sight.channels.find(candidate.layer);
    if (channels == sight.channels.end()) {
      drive.process_missing();
      return;
    }
    const int index = candidate.key.filter - uses_.at(candidate.layer).first;
    drive.process(channels->second[static_cast<std::size_t>(index)], sight.frame);
  }

  [[nodiscard]] std::size_t size() const { return members_.size(); }

 private:
  const SearchPlan& plan_;
  const KittiSequence& sequence_;
  std::span<const BlockMember> members_;
  std::map<std::size_t, LayerUse> uses_;
};

/// One task per filter, and first of all, where there is one, the preparation of the next frame.
Sight process_all(const Block& block, const Sight& sight, std::size_t next, std::size_t end) {
  Sight ahead;
  const int num_ahead = next < end ? 1 : 0;
  const int num_tasks = static_cast<int>(block.size()) + num_ahead;
  cv::parallel_for_(
      cv::Range(0, num_tasks),
      [&](const cv::Range& range) {
        for (int task = range.start; task < range.end; ++task) {
          if (task < num_ahead) {
            ahead = block.look(next);
          } else {
            block.process(static_cast<std::size_t>(task - num_ahead), sight);
          }
        }
      },
      num_tasks);
  return ahead;
}

void add_new(const std::vector<std::string>& problems, std::vector<std::string>& warnings) {
  for (const std::string& problem : problems) {
    if (std::find(warnings.begin(), warnings.end(), problem) == warnings.end()) {
      warnings.push_back(problem);
    }
  }
}

}  // namespace

bool run_block(const SearchPlan& plan,
               const KittiSequence& sequence,
               std::span<const BlockMember> members,
               std::size_t begin,
               std::size_t end,
               const FrameCallback& callback,
               std::vector<std::string>& warnings) {
  for (const BlockMember& member : members) {
    STEMVO_CHECK(member.drive->num_frames() == begin, "the filters of a block are at one frame");
  }
  if (members.empty() || begin >= end) {
    return true;
  }
  const Block block(plan, sequence, members);
  Sight sight = block.look(begin);
  for (std::size_t i = begin; i < end; ++i) {
    add_new(sight.problems, warnings);
    sight = process_all(block, sight, i + 1, end);
    if (!callback(members.size())) {
      return false;
    }
  }
  return true;
}

}  // namespace stemvo::search
