// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

#include "search/identity.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

/// Where results go, and where named models are found.
struct Folders {
  std::filesystem::path out_dir;
  std::filesystem::path models_dir;
};

/// sheet.png: the input and the channels of the best, the median and the worst filter that was
/// ranked, on the middle frame of the first sequence, above their trajectories (trajectories.png).
/// Nothing where no filter was ranked. Error: the sequence or the model is not where it was.
[[nodiscard]] Status write_contact_sheet(const Folders& folders,
                                         const SearchIdentity& identity,
                                         const SearchReport& report);

}  // namespace stemvo::search
