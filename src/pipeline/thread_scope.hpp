// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

#include <opencv2/core/utility.hpp>
#include <tbb/global_control.h>

namespace stemvo::pipeline {

/// While it lives, OpenCV works on `num_threads` threads (0: one per core) in the whole process:
/// the program's part of --threads. The library leaves OpenCV alone.
class ThreadScope {
 public:
  explicit ThreadScope(int num_threads)
      : num_threads_(num_threads > 0 ? num_threads : cv::getNumberOfCPUs()) {
    cv::setNumThreads(num_threads_);
  }
  ~ThreadScope() { cv::setNumThreads(opencv_before_); }
  ThreadScope(const ThreadScope&) = delete;
  ThreadScope& operator=(const ThreadScope&) = delete;

 private:
  int num_threads_;
  int opencv_before_ = cv::getNumThreads();
  /// Limits OpenCV's threads where it is built with TBB.
  tbb::global_control limit_{tbb::global_control::max_allowed_parallelism,
                             static_cast<std::size_t>(num_threads_)};
};

}  // namespace stemvo::pipeline
