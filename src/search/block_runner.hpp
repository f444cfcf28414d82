// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "search/drive_score.hpp"
#include "search/plan.hpp"

namespace stemvo::search {

/// A filter of a block and the drive that its channels go to.
struct BlockMember {
  const Candidate* candidate = nullptr;
  FilterDrive* drive = nullptr;
};

/// Called after each frame with the number of filter-frames it was; false stops.
using FrameCallback = std::function<bool(std::size_t)>;

/// Runs filters in lock-step over frames [begin, end) of one sequence: a frame is read once, each
/// layer makes one pass over it, then the filters work side by side, while the next frame is
/// prepared. What a drive sees does not depend on the number of threads or on who runs beside it.
/// All drives have `begin` frames so far (checked). False: the callback stopped it. A frame that
/// cannot be read, or a stem that refuses it, is a line in `warnings`.
[[nodiscard]] bool run_block(const SearchPlan& plan,
                             const KittiSequence& sequence,
                             std::span<const BlockMember> members,
                             std::size_t begin,
                             std::size_t end,
                             const FrameCallback& callback,
                             std::vector<std::string>& warnings);

}  // namespace stemvo::search
