// SPDX-License-Identifier: MIT
#pragma once

#include <atomic>
#include <functional>

namespace stemvo::pipeline {

/// A loop that several threads work on. Each takes stripes of it until none is left.
class SharedLoop {
 public:
  using Body = std::function<void(int begin, int end)>;
  SharedLoop(int num_stripes, int num_threads, Body body);

  [[nodiscard]] bool has_stripes_left() const { return next_ < num_stripes_; }
  void work();

  int num_helpers = 0;  ///< threads in work() beside the one whose loop it is; its crew's mutex

 private:
  int num_stripes_;
  int stripes_at_once_;
  Body body_;
  std::atomic<int> next_ = 0;
};

/// Threads that run a loop of one of them together.
class LoopCrew {
 public:
  virtual ~LoopCrew() = default;
  [[nodiscard]] virtual int num_threads() const = 0;
  /// Called by a member; returns when all of the loop is done.
  virtual void run_loop(int num_stripes, const SharedLoop::Body& body) = 0;
};

/// While one lives, OpenCV's loops (cv::parallel_for_) of a crew's members are run by that crew,
/// those of other threads by the calling thread alone: OpenCV's own threads rest. The first is made
/// and the last destroyed while no member works.
class OpenCvLoops {
 public:
  OpenCvLoops();
  ~OpenCvLoops();
  OpenCvLoops(const OpenCvLoops&) = delete;
  OpenCvLoops& operator=(const OpenCvLoops&) = delete;
};

/// While it lives, the thread that made it is a member of the crew; `index` counts from 0.
class CrewMember {
 public:
  CrewMember(LoopCrew& crew, int index);
  ~CrewMember();
  CrewMember(const CrewMember&) = delete;
  CrewMember& operator=(const CrewMember&) = delete;

 private:
  LoopCrew* crew_before_;
  int index_before_;
};

}  // namespace stemvo::pipeline
