// SPDX-License-Identifier: MIT
#pragma once

#include "pipeline/result_files.hpp"

namespace stemvo::pipeline {

/// Takes a run's frames through the odometry and keeps what each brings. Rows of frames.csv,
/// trajectory_kitti.txt and trajectory_tum.txt grow on the disk meanwhile: a run that is killed
/// loses less than two seconds.
[[nodiscard]] Drive run_drive(const Run& run, const RunProgress& progress);

}  // namespace stemvo::pipeline
