// SPDX-License-Identifier: MIT
#pragma once

#include <utility>

#if defined(__SANITIZE_THREAD__)
#define STEMVO_THREAD_SANITIZER  // GCC
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define STEMVO_THREAD_SANITIZER  // Clang
#endif
#endif

#ifdef STEMVO_THREAD_SANITIZER
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
#ifdef STEMVO_THREAD_SANITIZER
    __tsan_release(this);
#endif
  }
  void take() {
#ifdef STEMVO_THREAD_SANITIZER
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

/// A method of `object` as TBB is given it, to call in any thread: a Turn around it.
template <auto kMethod, typename Object>
class HandedOver {
 public:
  HandedOver(HandOver& before, HandOver& after, Object& object)
      : before_(&before), after_(&after), object_(&object) {}
  /// Nothing is known of the thread that made this, or a pointer given, until before_ was taken.
  template <typename... Arguments>
  STEMVO_NOT_INSTRUMENTED decltype(auto) operator()(Arguments&&... arguments) const {
    const Turn turn(*before_, *after_);
    return (object_->*kMethod)(std::forward<Arguments>(arguments)...);
  }

 private:
  HandOver* before_;
  HandOver* after_;
  Object* object_;
};

}  // namespace stemvo
