// SPDX-License-Identifier: MIT
#include "pipeline/input_notes.hpp"

#include <string>

#include <fmt/format.h>

namespace stemvo::pipeline {

std::string count_matched(const RunRequest& request,
                          std::size_t num_matched,
                          std::size_t num_frames) {
  const std::string others = fmt::format(" (the others have none within {} s: --gt-tolerance)",
                                         request.ground_truth_tolerance_s);
  return fmt::format(" for {} of {} frames{}", num_matched, num_frames,
                     num_matched < num_frames ? others : "");
}

namespace {

std::string describe_truth(const RunRequest& request, const FrameSource& sequence) {
  if (!sequence.has_ground_truth()) {
    return "no ground truth";
  }
  if (sequence.stream()) {
    return "ground truth to be matched";
  }
  const auto& frames = sequence.frames().ground_truth_frames;
  return "ground truth" +
         (frames ? count_matched(request, frames->size(), sequence.size()) : std::string());
}

std::string describe_size(const FrameSource& sequence) {
  const Camera& camera = sequence.camera();
  const std::string count =
      sequence.stream() ? "frames" : fmt::format("{} frames", sequence.size());
  const cv::Size full = sequence.frames().full_size;
  const std::string worked_on =
      full == cv::Size(camera.width_px, camera.height_px)
          ? ""
          : fmt::format(" worked on at {}x{}", camera.width_px, camera.height_px);
  return fmt::format("{} of {}x{} pixels{}", count, full.width, full.height, worked_on);
}

}  // namespace

void note_input(const RunRequest& request, const FrameSource& sequence) {
  if (request.note) {
    request.note(fmt::format("input: {} {}, {}, {}", sequence.kind(), sequence.name(),
                             describe_size(sequence), describe_truth(request, sequence)));
  }
}

std::size_t expected_frames(const FrameSource& sequence, std::size_t num_done) {
  if (!sequence.stream()) {
    return sequence.size();
  }
  const std::size_t told = sequence.stream()->expected_frames;
  return told > num_done ? told : 0;  // a last frame is known by what comes behind it
}

void end_stream(const FrameSource& sequence, const RunProgress& progress, Drive& drive) {
  const std::size_t num_done = drive.trajectory.size();
  if (sequence.stream()->is_live) {
    drive.interrupted = false;
  }
  if (drive.interrupted) {
    return;
  }
  if (progress) {
    (void)progress(num_done, num_done);
  }
  constexpr double kMinShare = 0.9;  // containers without an index guess
  const std::size_t told = sequence.stream()->expected_frames;
  if (static_cast<double>(num_done) < kMinShare * static_cast<double>(told)) {
    drive.warnings.push_back(fmt::format(
        "{}: the video ends after {} frames where {} were expected: it may be cut off or damaged",
        sequence.name(), num_done, told));
  }
}

}  // namespace stemvo::pipeline
