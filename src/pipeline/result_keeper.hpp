// SPDX-License-Identifier: MIT
#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>

#include "evaluation/trajectory.hpp"
#include "stemvo/error.hpp"

namespace stemvo::pipeline {

/// Keeps frames.csv, trajectory_kitti.txt and the checkpoint of a run on disk while it runs, so
/// that one that is killed loses less than two seconds. Every second a thread of its own, which
/// sleeps otherwise, replaces each by one with all frames so far, whole.
class ResultKeeper {
 public:
  /// `finished`: the trajectory as it is written, of that of the frames so far.
  ResultKeeper(const std::filesystem::path& out_dir,
               std::function<Trajectory(Trajectory)> finished);
  ~ResultKeeper() { stop(); }
  ResultKeeper(const ResultKeeper&) = delete;
  ResultKeeper& operator=(const ResultKeeper&) = delete;

  /// Writes the header of frames.csv and begins. Error: it cannot be written; no thread to be had.
  [[nodiscard]] Status start();
  /// Before start(): the rows and poses that there are already.
  void go_on(std::string csv, Trajectory trajectory);
  /// The next frame.
  void add(std::string_view csv_row, const Rigid3& world_from_camera);
  /// All rows so far.
  [[nodiscard]] std::string csv();
  /// What OUT_DIR/checkpoint is to hold.
  void keep_checkpoint(std::string bytes);
  /// Ends, and writes all of frames.csv; the trajectories are the caller's from here on.
  [[nodiscard]] Status finish();

 private:
  void stop();
  void keep(const std::stop_token& token);

  std::filesystem::path out_dir_;
  std::function<Trajectory(Trajectory)> finished_;
  std::mutex mutex_;  ///< of what the frames bring
  std::condition_variable_any stopped_;
  std::string csv_;
  Trajectory trajectory_;
  std::string checkpoint_;  ///< not written yet
  std::jthread thread_;
};

}  // namespace stemvo::pipeline
