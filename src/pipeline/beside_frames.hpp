// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "dataset/frame_source.hpp"
#include "dataset/motion_file.hpp"
#include "odometry/way.hpp"
#include "pipeline/run.hpp"
#include "stemvo/error.hpp"
#include "stemvo/odometry.hpp"

namespace stemvo::pipeline {

/// Facts on a recording's motion beside its frames.
struct BesideFrames {
  std::vector<Way> ways;                ///< by speeds
  std::vector<dataset::GyroRow> gyro;   ///< in the camera's axes
  std::string note;                     ///< what there is, for the line of the input; may be empty
  std::vector<std::string> unit_notes;  ///< how times were read, a line each; may be empty
  struct Span {
    std::string option;
    double first_s;
    double last_s;
  };
  std::vector<Span> spans;  ///< of the files read

  /// For the frame of this time, behind one of that time.
  [[nodiscard]] FrameHints hints(double last_s, double time_s) const;
  /// A line for each file whose times are all before or all behind those of the frames.
  [[nodiscard]] std::vector<std::string> warnings(double first_s, double last_s) const;
};

/// Reads the files that were asked for. Errors: theirs; speeds beside a scale.source that leaves no
/// room for them.
[[nodiscard]] Expected<BesideFrames> read_beside_frames(const RunRequest& request,
                                                        const FrameSource& sequence);

}  // namespace stemvo::pipeline
