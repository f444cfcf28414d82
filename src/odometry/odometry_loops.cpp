// SPDX-License-Identifier: MIT
#include "odometry/odometry_loops.hpp"

namespace stemvo {

FrameLoops::FrameLoops(FrameStages stages, int num_threads) : stages_(std::move(stages)) {
  if (num_threads <= 1) {
    return;
  }
  try {
    for (const auto loop :
         {&FrameLoops::prepare, &FrameLoops::track_and_localize, &FrameLoops::optimize}) {
      threads_.emplace_back([this, loop] { guard([&] { (this->*loop)(); }); });
    }
  } catch (...) {
    stop(nullptr);
    throw;
  }
}

bool FrameLoops::push(const std::function<void(std::size_t)>& fill) {
  const std::size_t k = num_pushed_;  // which nobody else changes
  if (!wait(k, [&] { return k < num_optimized_ + kMaxInFlight; })) {
    return false;
  }
  fill(k);
  advance(num_pushed_);
  if (threads_.empty()) {
    guard([&] { take_through(k); });
  }
  const std::lock_guard lock(mutex_);
  return !is_stopped_;
}

FrameStages OdometryLoops::stages() {
  return {.prepare =
              [this](std::size_t k) {
                auto& [given, frame] = slot(k);
                frame = given.image ? odometry_.prepare(*given.image, given.time_s, given.hints)
                                    : Frame();
                frame.time_s = given.time_s;
                frame.hints.prev_from_cur = given.hints.prev_from_cur;
                frame.ways = std::move(given.ways);
              },
          .track = [this](std::size_t k) { odometry_.track(std::move(slot(k).frame)); },
          .localize =
              [this](std::size_t) {
                const std::lock_guard lock(state_);
                odometry_.localize();
              },
          .optimize =
              [this](std::size_t k) {
                const FrameResult result = [&] {
                  const std::lock_guard lock(state_);
                  return odometry_.optimize();
                }();
                const GivenFrame given = std::move(slot(k).given);  // its pixels go with it
                return deliver_(given, result);
              }};
}

}  // namespace stemvo
