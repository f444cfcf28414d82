// SPDX-License-Identifier: MIT
#include "odometry/odometry_loops.hpp"

#include <utility>

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

FrameLoops::~FrameLoops() { stop(nullptr); }

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

bool FrameLoops::wait_for_all() {
  const std::size_t next = num_pushed_;
  return wait(next, [&] { return num_optimized_ == next; });
}

bool FrameLoops::wait_for(std::size_t k) {
  return wait(k, [&] { return k < num_optimized_; });
}

bool FrameLoops::has_thrown() const {
  const std::lock_guard lock(mutex_);
  return thrown_ != nullptr;
}

void FrameLoops::finish() {
  {
    const std::lock_guard lock(mutex_);
    num_frames_ = num_pushed_;
    changed_.notify_all();
  }
  threads_.clear();
  if (thrown_ != nullptr) {
    std::rethrow_exception(thrown_);
  }
}

void FrameLoops::prepare() {
  for (std::size_t k = 0; wait(k, [&] { return k < num_pushed_; }); ++k) {
    stages_.prepare(k);
    advance(num_prepared_);
  }
}

void FrameLoops::track_and_localize() {
  for (std::size_t k = 0; wait(k, [&] { return k < num_prepared_; }); ++k) {
    stages_.track(k);
    if (wait(k, [&] { return k == num_optimized_; })) {
      stages_.localize(k);
      advance(num_localized_);
    }
  }
}

void FrameLoops::optimize() {
  for (std::size_t k = 0; wait(k, [&] { return k < num_localized_; }); ++k) {
    if (!stages_.optimize(k)) {
      stop(nullptr);
    }
    advance(num_optimized_);
  }
}

void FrameLoops::take_through(std::size_t k) {
  stages_.prepare(k);
  stages_.track(k);
  stages_.localize(k);
  if (!stages_.optimize(k)) {
    stop(nullptr);
  }
  advance(num_optimized_);
}

template <typename Work>
void FrameLoops::guard(const Work& work) {
  try {
    work();
  } catch (...) {
    stop(std::current_exception());
  }
}

/// Until `may_go_on`; false: frame k is not to be done.
template <typename Condition>
bool FrameLoops::wait(std::size_t k, const Condition& may_go_on) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return is_stopped_ || k >= num_frames_ || may_go_on(); });
  return !is_stopped_ && k < num_frames_;
}

void FrameLoops::advance(std::size_t& count) {
  const std::lock_guard lock(mutex_);
  ++count;
  changed_.notify_all();
}

void FrameLoops::stop(const std::exception_ptr& thrown) {
  const std::lock_guard lock(mutex_);
  thrown_ = thrown_ == nullptr ? thrown : thrown_;
  is_stopped_ = true;
  changed_.notify_all();
}

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
