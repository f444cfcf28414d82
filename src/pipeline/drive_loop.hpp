// SPDX-License-Identifier: MIT
#pragma once

#include "pipeline/result_files.hpp"

namespace stemvo::pipeline {

/// Takes a run's frames through the odometry and keeps what each brings. Every second frames.csv
/// and trajectory_kitti.txt are replaced on the disk by ones with all frames so far, each whole: a
/// run that is killed loses less than two seconds.
[[nodiscard]] Drive run_drive(const Run& run, const RunProgress& progress);

}  // namespace stemvo::pipeline
