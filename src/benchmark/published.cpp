// SPDX-License-Identifier: MIT
#include "benchmark/published.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

namespace stemvo::benchmark {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<std::string_view, 11> kNames = {"00", "01", "02", "03", "04", "05",
                                                     "06", "07", "08", "09", "10"};

/// One row of a published table; NaN where it has no number. Index = sequence.
struct Table {
  std::string_view method;
  std::string_view scale;
  std::string_view alignment;
  std::string_view source;
  std::array<double, 11> values;
  std::array<double, 11> rotations = {};  ///< beside t_rel, where has_rotations
  bool has_rotations = false;
};

constexpr std::string_view kPaper = "J. Imaging 2025, 11(5), 155, Table 4";
constexpr std::string_view kAsPrinted = "none named; as printed";
constexpr std::string_view kGiga = "GigaSLAM, Table 1";
constexpr std::string_view kSim3 = "Sim(3)";
constexpr std::string_view kFitted = "fitted";
constexpr std::string_view kDfvo = "DF-VO, result table of its repository";
constexpr std::string_view kMetric3d = "Metric3D, Table 5";
constexpr std::string_view kD3vo = "D3VO, Table 4";
constexpr std::string_view kNotSaid = "not said";

// clang-format off
/// Average offset, m.
constexpr std::array kOffsets = {
    Table{"the paper", "ground truth, each step", kAsPrinted, kPaper,
          {476.40, kNone, 1451.84, kNone, kNone, 286.65, 310.44, kNone, 374.23, 536.42, kNone}},
    Table{"DeepVO, as the paper has it", kNotSaid, kAsPrinted, kPaper,
          {13227.92, kNone, 13005.68, kNone, kNone, 17250.48, 17774.23, kNone, 23942.91, 4379.55, kNone}},
    Table{"TartanVO, as the paper has it", kNotSaid, kAsPrinted, kPaper,
          {124361.71, kNone, 317924.60, kNone, kNone, 133977.30, 45526.16, kNone, 203107.88, 110614.15, kNone}},
    Table{"two frames, ORB, brute force", "ground truth, each step", "none", "results of Shiaoming/Python-VO, judged here",
          {434.7, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone}},
    Table{"two frames, SIFT, FLANN", "ground truth, each step", "none", "results of Shiaoming/Python-VO, judged here",
          {21.4, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone}},
};

/// Root mean square position error after Sim(3), m.
constexpr std::array kAtes = {
    Table{"ORB-SLAM2, one camera, no loop closing", kFitted, kSim3, kGiga,
          {40.65, 502.20, 47.82, 0.94, 1.30, 29.95, 40.82, 16.04, 43.09, 38.77, 5.42}},
    Table{"ORB-SLAM2, one camera, loop closing", kFitted, kSim3, kGiga,
          {6.03, 508.34, 14.76, 1.02, 1.57, 4.04, 11.16, 2.19, 38.85, 8.39, 6.63}},
    Table{"LDSO, loop closing", kFitted, kSim3, kGiga,
          {9.32, 11.68, 31.98, 2.85, 1.22, 5.10, 13.55, 2.96, 129.02, 21.64, 17.36}},
    Table{"DF-VO", kFitted, kSim3, kGiga,
          {14.45, 117.40, 19.69, 1.00, 1.39, 3.61, 3.20, 0.98, 7.63, 8.36, 3.13}},
    Table{"DROID-VO", kFitted, kSim3, kGiga,
          {98.43, 84.20, 108.80, 2.58, 0.93, 59.27, 64.40, 24.20, 64.55, 71.80, 16.91}},
    Table{"DPVO", kFitted, kSim3, kGiga,
          {113.21, 12.69, 123.40, 2.09, 0.68, 58.96, 54.78, 19.26, 115.90, 75.10, 13.63}},
    Table{"DROID-SLAM", kFitted, kSim3, kGiga,
          {92.10, 344.60, 107.61, 2.38, 1.00, 118.50, 62.47, 21.78, 161.60, 72.32, 118.70}},
    Table{"DPV-SLAM", kFitted, kSim3, kGiga,
          {112.80, 11.50, 123.53, 2.50, 0.81, 57.80, 54.86, 18.77, 110.49, 76.66, 13.65}},
    Table{"DPV-SLAM++, loop closing", kFitted, kSim3, kGiga,
          {8.30, 11.86, 39.64, 2.50, 0.78, 5.74, 11.60, 1.52, 110.90, 76.70, 13.70}},
    Table{"GigaSLAM, no loop closing", kFitted, kSim3, kGiga,
          {7.09, 129.74, 12.34, 2.49, 2.25, 5.92, 2.61, 2.59, 9.48, 4.03, 2.27}},
    Table{"GigaSLAM, loop closing", kFitted, kSim3, kGiga,
          {6.83, 127.39, 11.30, 2.18, 1.88, 4.36, 2.11, 2.12, 7.04, 3.94, 2.18}},
};

/// t_rel % and r_rel degrees per 100 m.
constexpr std::array kSegments = {
    Table{"ORB-SLAM2, one camera, no loop closing", kFitted, "7 degrees of freedom", "Metric3D, Table 5; D3VO, Table 4",
          {11.43, kNone, 10.34, kNone, kNone, 9.04, 14.56, kNone, 11.46, 9.30, 2.57},
          {0.58, kNone, 0.26, kNone, kNone, 0.26, 0.26, kNone, 0.28, 0.26, 0.32}, true},
    Table{"DF-VO, one camera", kFitted, "7 degrees of freedom", kDfvo,
          {2.25, 66.98, 3.60, 2.67, 1.43, 1.15, 1.03, 0.93, 2.23, 2.47, 1.96},
          {0.58, 17.04, 0.52, 0.50, 0.29, 0.30, 0.26, 0.29, 0.30, 0.30, 0.31}, true},
    Table{"DF-VO, trained on stereo", "training", "6 degrees of freedom", kDfvo,
          {1.96, 56.76, 2.38, 2.49, 1.03, 1.10, 1.03, 0.97, 1.60, 2.61, 2.29},
          {0.60, 13.93, 0.55, 0.39, 0.25, 0.30, 0.30, 0.27, 0.32, 0.29, 0.37}, true},
    Table{"VISO2-M", "camera height", kNotSaid, kMetric3d,
          {12.66, kNone, 9.47, kNone, kNone, 15.1, 6.8, kNone, 14.82, 3.69, 21.01},
          {2.73, kNone, 1.19, kNone, kNone, 3.65, 1.93, kNone, 2.52, 1.25, 3.26}, true},
    Table{"DROID-SLAM, one camera", kNotSaid, kNotSaid, kMetric3d,
          {33.9, kNone, 34.88, kNone, kNone, 23.4, 17.2, kNone, 39.6, 21.7, 7.0},
          {0.29, kNone, 0.27, kNone, kNone, 0.27, 0.26, kNone, 0.31, 0.23, 0.25}, true},
    Table{"DROID-SLAM with the depth of Metric3D", "learned depth", kNotSaid, kMetric3d,
          {1.44, kNone, 2.64, kNone, kNone, 1.44, 0.6, kNone, 2.2, 1.63, 2.73},
          {0.37, kNone, 0.29, kNone, kNone, 0.25, 0.20, kNone, 0.30, 0.22, 0.23}, true},
    Table{"DSO, one camera", kNotSaid, kNotSaid, kD3vo,
          {kNone, 9.17, 114, kNone, kNone, kNone, 42.2, kNone, 177, 28.1, 24.0}},
    Table{"D3VO, trained on stereo", "training", "no scale", kD3vo,
          {kNone, 1.07, 0.80, kNone, kNone, kNone, 0.67, kNone, 1.00, 0.78, 0.62}},
    Table{"ORB-SLAM2, stereo", "stereo", kNotSaid, kD3vo,
          {kNone, 1.38, 0.81, kNone, kNone, kNone, 0.82, kNone, 1.07, 0.82, 0.58}},
    Table{"Stereo DSO", "stereo", kNotSaid, kD3vo,
          {kNone, 1.43, 0.78, kNone, kNone, kNone, 0.67, kNone, 0.98, 0.98, 0.49}},
    Table{"SC-Depth, pose network", kNotSaid, kNotSaid, "SC-SfMLearner, README",
          {kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 7.31, 7.79},
          {kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 3.05, 4.90}, true},
    Table{"SfMLearner", kNotSaid, kNotSaid, "D3VO, Table 5",
          {kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 17.84, 37.91}},
    Table{"MVOScaleRecovery (segments of 800 m only)", "camera height", kNotSaid, "its README",
          {2.17, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone}},
};
// clang-format on

std::optional<double> number(double value) {
  return std::isnan(value) ? std::nullopt : std::optional(value);
}

enum class Kind { kOffset, kAte, kSegment };

void append(std::vector<PublishedNumbers>& to,
            std::span<const Table> tables,
            std::size_t sequence,
            Kind kind) {
  for (const Table& table : tables) {
    const std::optional<double> value = number(table.values[sequence]);
    if (!value) {
      continue;
    }
    PublishedNumbers row{.method = table.method,
                         .scale = table.scale,
                         .alignment = table.alignment,
                         .t_rel_percent = std::nullopt,
                         .r_rel_deg_per_100m = std::nullopt,
                         .average_offset_m = std::nullopt,
                         .ate_rmse_m = std::nullopt,
                         .source = table.source};
    if (kind == Kind::kOffset) {
      row.average_offset_m = value;
    } else if (kind == Kind::kAte) {
      row.ate_rmse_m = value;
    } else {
      row.t_rel_percent = value;
      row.r_rel_deg_per_100m =
          table.has_rotations ? number(table.rotations[sequence]) : std::nullopt;
    }
    to.push_back(row);
  }
}

}  // namespace

std::vector<PublishedNumbers> published_numbers(std::string_view name) {
  const auto* const found = std::find(kNames.begin(), kNames.end(), name);
  std::vector<PublishedNumbers> rows;
  if (found != kNames.end()) {
    const auto sequence = static_cast<std::size_t>(found - kNames.begin());
    append(rows, kOffsets, sequence, Kind::kOffset);
    append(rows, kSegments, sequence, Kind::kSegment);
    append(rows, kAtes, sequence, Kind::kAte);
  }
  return rows;
}

}  // namespace stemvo::benchmark
