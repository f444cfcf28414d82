// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string>

#include "pipeline/checkpoint.hpp"
#include "pipeline/result_files.hpp"

namespace stemvo::pipeline {

/// Takes a run's frames through the odometry and keeps what each brings. Every second frames.csv,
/// trajectory_kitti.txt and, where there is a new one, the checkpoint are replaced on the disk by
/// ones with all frames so far, each whole: a run that is killed loses less than two seconds.
/// `identity`: as of pack(). `from`: its state is the odometry's already.
[[nodiscard]] Drive run_drive(const Run& run,
                              const std::string& identity,
                              std::optional<Checkpoint> from,
                              const RunProgress& progress);

}  // namespace stemvo::pipeline
