// SPDX-License-Identifier: MIT
#include "search/joined_records.hpp"

#include <fmt/format.h>

#include "search/record_json.hpp"

namespace stemvo::search {
namespace {

bool same_score(const FilterKey& key, const DriveScore& a, const DriveScore& b) {
  Record first;
  first.key = key;
  first.held_out = a;
  Record second = first;
  second.held_out = b;
  return record_line(first) == record_line(second);
}

}  // namespace

Status JoinedRecords::add(const std::filesystem::path& part, const std::vector<Record>& records) {
  for (const Record& record : records) {
    Status status;
    for (const DriveScore& drive : record.drives) {
      status = status ? add_score(part, record.key, false, drive) : status;
    }
    if (status && record.held_out) {
      status = add_score(part, record.key, true, *record.held_out);
    }
    if (!status) {
      return status;
    }
  }
  return {};
}

Status JoinedRecords::add_score(const std::filesystem::path& part,
                                const FilterKey& key,
                                bool is_held_out,
                                const DriveScore& score) {
  const auto [place, is_new] =
      scores_[key].try_emplace(SequenceKey(is_held_out, score.sequence), score);
  if (!is_new && !same_score(key, place->second, score)) {
    return fail(
        fmt::format("{}: expected the result of another part for {} on {}, found another one",
                    part.string(), to_string(key), score.sequence));
  }
  return {};
}

Expected<std::vector<Record>> JoinedRecords::all(const SearchIdentity& identity) const {
  std::vector<Record> records;
  for (const auto& [key, scores] : scores_) {
    Record& record = records.emplace_back();
    record.key = key;
    for (const SequenceIdentity& sequence : identity.sequences) {
      const auto found = scores.find(SequenceKey(sequence.is_held_out, sequence.name));
      if (found == scores.end()) {
        return fail(fmt::format("--merge: expected a part with {} on {}{}, found none",
                                to_string(key), sequence.name,
                                sequence.is_held_out ? " (held out)" : ""));
      }
      // An exhaustive search runs each frame once, or none where the layer cannot be run.
      if (sequence.is_held_out) {
        record.held_out = found->second;
        record.held_out_filter_frames = found->second.num_frames;
      } else {
        record.drives.push_back(found->second);
        record.filter_frames += found->second.num_frames;
      }
    }
  }
  return records;
}

}  // namespace stemvo::search
