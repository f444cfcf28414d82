// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <ceres/crs_matrix.h>

#include "calibration/joint_adjustment.hpp"
#include "calibration/segment.hpp"

namespace stemvo::calibration {

/// Eliminates landmarks, then poses, from J^T J and J^T r of one segment (Schur complements; Triggs
/// et al., "Bundle adjustment - a modern synthesis", section 6). Columns: 3 per landmark, the
/// poses, the shared numbers last; rows: 2 per observation, in the order of the landmarks.
[[nodiscard]] SegmentInformation eliminate(const Segment& segment,
                                           const std::vector<double>& residuals,
                                           const ceres::CRSMatrix& jacobian);

/// Standard deviations of the free numbers; 0 for the others, infinite where the information is
/// singular. The larger of two: the inverse information times the variance of the residuals, and
/// the cluster-robust one (Liang and Zeger, Biometrika 1986) with segments as clusters, which also
/// sees errors that the tracks of a segment share.
[[nodiscard]] SharedVector standard_deviations(const std::vector<SegmentInformation>& segments,
                                               const SharedMask& is_free,
                                               double residual_variance_px2);

}  // namespace stemvo::calibration
