// SPDX-License-Identifier: MIT
#pragma once

#include <tbb/global_control.h>

namespace stemvo::pipeline {

/// While it lives, the process works on `num_threads` threads (0: one per core), OpenCV's included.
class ThreadScope {
 public:
  explicit ThreadScope(int num_threads);
  ~ThreadScope();
  ThreadScope(const ThreadScope&) = delete;
  ThreadScope& operator=(const ThreadScope&) = delete;

 private:
  tbb::global_control limit_;  ///< of OpenCV's threads where it is built with TBB
  int opencv_before_;
};

}  // namespace stemvo::pipeline
