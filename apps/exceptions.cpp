// SPDX-License-Identifier: MIT
#include "exceptions.hpp"

#include <new>
#include <system_error>

#include <execinfo.h>
#include <opencv2/core.hpp>

namespace stemvo::apps {
namespace {

constexpr const char* kNoMemory =
    "out of memory: expected more than there is, or than 'ulimit -v' allows";

}  // namespace

void prepare_exceptions() {
  void* frame = nullptr;
  backtrace(&frame, 1);
}

std::string describe(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const std::bad_alloc&) {
    return kNoMemory;
  } catch (const cv::Exception& opencv) {
    return opencv.code == cv::Error::StsNoMem ? kNoMemory
                                              : std::string("internal: ") + opencv.what();
  } catch (const std::system_error& system) {
    return system.code() == std::errc::resource_unavailable_try_again
               ? "out of threads: expected more than 'ulimit -u' allows, or more memory for them"
               : system.what();
  } catch (const std::exception& other) {
    return std::string("internal: ") + other.what();
  } catch (...) {
    return "internal: unknown exception";
  }
}

}  // namespace stemvo::apps
