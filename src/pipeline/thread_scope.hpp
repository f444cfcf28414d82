// SPDX-License-Identifier: MIT
#pragma once

#include <opencv2/core/utility.hpp>

namespace stemvo::pipeline {

/// OpenCV's number of threads belongs to the process: it is given back. 0: all cores.
class ThreadScope {
 public:
  explicit ThreadScope(int num_threads) : before_(cv::getNumThreads()) {
    cv::setNumThreads(num_threads > 0 ? num_threads : cv::getNumberOfCPUs());
  }
  ~ThreadScope() { cv::setNumThreads(before_); }
  ThreadScope(const ThreadScope&) = delete;
  ThreadScope& operator=(const ThreadScope&) = delete;

 private:
  int before_;
};

}  // namespace stemvo::pipeline
