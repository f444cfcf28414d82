// SPDX-License-Identifier: MIT
#include "pipeline/thread_scope.hpp"

#include <opencv2/core/utility.hpp>

namespace stemvo::pipeline {
namespace {

int threads_for(int asked) { return asked > 0 ? asked : cv::getNumberOfCPUs(); }

}  // namespace

ThreadScope::ThreadScope(int num_threads)
    : limit_(tbb::global_control::max_allowed_parallelism,
             static_cast<std::size_t>(threads_for(num_threads))),
      opencv_before_(cv::getNumThreads()) {
  cv::setNumThreads(threads_for(num_threads));
}

ThreadScope::~ThreadScope() { cv::setNumThreads(opencv_before_); }

}  // namespace stemvo::pipeline
