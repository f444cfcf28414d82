// SPDX-License-Identifier: MIT
#include "pipeline/result_keeper.hpp"

#include <chrono>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "pipeline/checkpoint.hpp"
#include "report/frames_csv.hpp"
#include "text/text_file.hpp"

namespace stemvo::pipeline {
namespace {

constexpr std::chrono::seconds kPeriod(1);

}  // namespace

ResultKeeper::ResultKeeper(const std::filesystem::path& out_dir,
                           std::function<Trajectory(Trajectory)> finished)
    : out_dir_(out_dir), finished_(std::move(finished)), csv_(frames_csv_header()) {}

Status ResultKeeper::start() {
  const Status status = write_text_file(out_dir_ / "frames.csv", csv_);
  if (!status) {
    return status;
  }
  try {
    thread_ = std::jthread([this](const std::stop_token& token) { keep(token); });
  } catch (const std::system_error& error) {
    return fail(fmt::format("{}: no thread to keep results with: {}", out_dir_.string(),
                            error.code().message()));
  }
  return {};
}

void ResultKeeper::go_on(std::string csv, Trajectory trajectory) {
  csv_ = std::move(csv);
  trajectory_ = std::move(trajectory);
}

std::string ResultKeeper::csv() {
  const std::lock_guard lock(mutex_);
  return csv_;
}

void ResultKeeper::keep_checkpoint(std::string bytes) {
  const std::lock_guard lock(mutex_);
  checkpoint_ = std::move(bytes);
}

void ResultKeeper::add(std::string_view csv_row, const Rigid3& world_from_camera) {
  const std::lock_guard lock(mutex_);
  csv_ += csv_row;
  trajectory_.push_back(world_from_camera);
}

Status ResultKeeper::finish() {
  stop();
  const Status written = write_text_file(out_dir_ / "frames.csv", csv_);
  const Status kept =
      checkpoint_.empty() ? Status() : write_text_file(checkpoint_file(out_dir_), checkpoint_);
  return written ? kept : written;
}

void ResultKeeper::stop() {
  if (thread_.joinable()) {
    thread_.request_stop();
    thread_.join();
  }
}

void ResultKeeper::keep(const std::stop_token& token) {
  std::unique_lock lock(mutex_);
  while (!stopped_.wait_for(lock, token, kPeriod, [&] { return token.stop_requested(); })) {
    if (trajectory_.empty()) {
      continue;
    }
    const std::string csv = csv_;
    Trajectory trajectory = trajectory_;
    const std::string checkpoint = std::exchange(checkpoint_, {});
    lock.unlock();
    // What cannot be written now is written, or reported, at the end.
    static_cast<void>(write_text_file(out_dir_ / "frames.csv", csv));
    static_cast<void>(write_kitti_trajectory(out_dir_ / "trajectory_kitti.txt",
                                             finished_(std::move(trajectory))));
    if (!checkpoint.empty()) {
      static_cast<void>(write_text_file(checkpoint_file(out_dir_), checkpoint));
    }
    lock.lock();
  }
}

}  // namespace stemvo::pipeline
