// SPDX-License-Identifier: MIT
#include "odometry/odometry_loops.hpp"

#include <utility>

namespace stemvo {

OdometryLoops::OdometryLoops(PhasedOdometry& odometry, Deliver deliver, int num_threads)
    : odometry_(odometry), deliver_(std::move(deliver)), loops_(stages(), num_threads) {}

bool OdometryLoops::push(GivenFrame given) {
  return loops_.push([&](std::size_t k) { slot(k).given = std::move(given); });
}

bool OdometryLoops::reset() {
  if (!loops_.wait_for_all()) {
    return false;
  }
  const std::lock_guard lock(state_);
  odometry_.reset();
  return true;
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
