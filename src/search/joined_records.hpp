// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "search/identity.hpp"
#include "search/ranking.hpp"
#include "search/record_file.hpp"

namespace stemvo::search {

/// What the parts of an exhaustive search found, joined by filter and sequence.
class JoinedRecords {
 public:
  /// What two parts hold is no trouble where they agree; else an error.
  [[nodiscard]] Status add(const std::filesystem::path& part, const std::vector<Record>& records);

  /// A record per filter, as a search over all sequences writes it. Error: a filter that no part
  /// ran on one of the sequences.
  [[nodiscard]] Expected<std::vector<Record>> all(const SearchIdentity& identity) const;

 private:
  /// Held out, name: one folder may rank with some frames and be held out with others.
  using SequenceKey = std::pair<bool, std::string>;
  using Scores = std::map<SequenceKey, DriveScore>;

  Status add_score(const std::filesystem::path& part,
                   const FilterKey& key,
                   bool is_held_out,
                   const DriveScore& score);

  std::map<FilterKey, Scores, KeyOrder> scores_;
};

}  // namespace stemvo::search
