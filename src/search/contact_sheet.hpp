// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <vector>

#include "search/identity.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

/// Where results go, and where named models are found.
struct Folders {
  std::filesystem::path out_dir;
  std::filesystem::path models_dir;
};

/// A filter of the sheet and what it is there.
struct ShownFilter {
  const char* place;
  const FilterRow* row;
};

/// Best, median and worst of the filters (no baselines) whose pose was detected, those that halving
/// stopped behind the others, the later the better; the same filter once.
[[nodiscard]] std::vector<ShownFilter> choose_rows(const SearchIdentity& identity,
                                                   const SearchReport& report);

/// sheet.png: the input and the channels of the filters of choose_rows on the middle frame of the
/// first sequence, above their trajectories (trajectories.png), and where they were stopped.
/// Nothing where there is none. Error: the sequence or the model is not where it was.
[[nodiscard]] Status write_contact_sheet(const Folders& folders,
                                         const SearchIdentity& identity,
                                         const SearchReport& report);

}  // namespace stemvo::search
