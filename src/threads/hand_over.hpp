// SPDX-License-Identifier: MIT
#pragma once

#include <utility>

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#define STEMVO_NOT_INSTRUMENTED __attribute__((no_sanitize("thread")))
#else
#define STEMVO_NOT_INSTRUMENTED
#endif

namespace stemvo {

/// Tells the thread sanitizer what TBB guarantees but hides from it, because TBB's library is not
/// instrumented: what a thread did before give() happened before what follows take() in another.
/// It orders nothing itself, and is nothing in every other build.
class HandOver {
 public:
  void give() {
#ifdef __SANITIZE_THREAD__
    __tsan_release(this);
#endif
  }
  void take() {
#ifdef __SANITIZE_THREAD__
    __tsan_acquire(this);
#endif
  }
};

/// From here to the end of the block: work that starts after what was given to `before`, and gives
/// itself to `after`.
class Turn {
 public:
  Turn(HandOver& before, HandOver& after) : after_(after) { before.take(); }
  explicit Turn(HandOver& both) : Turn(both, both) {}
  ~Turn() { after_.give(); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  HandOver& after_;
};

/// `work` as TBB is given it, to call in any thread: a Turn around it. It must stay where it is.
template <typename Work>
class HandedOver {
 public:
  HandedOver(HandOver& before, HandOver& after, const Work& work)
      : before_(&before), after_(&after), work_(&work) {}
  /// Nothing is known of the thread that made this object until before_ was taken.
  template <typename... Arguments>
  STEMVO_NOT_INSTRUMENTED decltype(auto) operator()(Arguments&&... arguments) const {
    const Turn turn(*before_, *after_);
    return (*work_)(std::forward<Arguments>(arguments)...);
  }

 private:
  HandOver* before_;
  HandOver* after_;
  const Work* work_;
};

}  // namespace stemvo
