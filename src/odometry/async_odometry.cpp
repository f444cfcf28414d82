// SPDX-License-Identifier: MIT
#include "stemvo/async_odometry.hpp"

#include <atomic>
#include <deque>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "odometry/answers.hpp"
#include "odometry/check_frame.hpp"
#include "odometry/event_log.hpp"
#include "odometry/odometry_loops.hpp"
#include "odometry/whole_map.hpp"

namespace stemvo {
namespace {

/// Each holds a pose and a few numbers; a program that never asks for them shall hear of it.
constexpr std::size_t kMaxWaiting = 1000;

}  // namespace

struct AsyncOdometry::Impl {
  Impl(PhasedOdometry given, const Camera& camera, ScaleSource source, Callback on_result)
      : odometry(std::move(given)),
        check(camera),
        ways(source),
        callback(std::move(on_result)),
        loops(odometry, [this](const GivenFrame&, const FrameResult& result) {
          deliver(result);
          return true;
        }) {}

  void deliver(const FrameResult& result) {
    struct Delivering {
      std::atomic<std::thread::id>& thread;
      ~Delivering() { thread = std::thread::id(); }
    };
    const Delivering scope{delivering};
    delivering = std::this_thread::get_id();
    log.observe(result);
    if (callback) {
      callback(result);
    } else {
      const std::lock_guard lock(results_mutex);
      results.push_back(result);
    }
  }

  [[nodiscard]] Status check_not_in_callback(const char* name) const {
    return delivering == std::this_thread::get_id()
               ? Status(fail(std::string(name) +
                             ": expected a call outside of the callback, found one in it"))
               : Status();
  }
  [[nodiscard]] Status check_few_wait() {
    const std::lock_guard lock(results_mutex);
    return results.size() < kMaxWaiting
               ? Status()
               : Status(fail("push: expected next() to take the results, found " +
                             std::to_string(results.size()) + " that wait for it"));
  }
  /// Why the loops take no frame.
  [[nodiscard]] Error ended() const {
    return fail(loops.has_thrown()
                    ? "the odometry has ended: an earlier frame or its callback failed, and "
                      "finish() throws why"
                    : "expected no frame after finish(), found one");
  }

  [[nodiscard]] Expected<WholeMap> adjusted_map(const std::string& asked,
                                                const std::vector<int>& covariance_of) const {
    return odometry.check_remembers(asked).and_then([&]() -> Expected<WholeMap> {
      WholeMap map = loops.ask([&](const auto&) { return WholeMap(odometry); });
      const Status status = map.adjust(covariance_of);
      return status ? Expected<WholeMap>(std::move(map)) : status.error();
    });
  }

  PhasedOdometry odometry;
  std::mutex turn;  ///< of push, finish and reset
  FrameCheck check;
  std::mutex ways_mutex;
  WayInput ways;
  Callback callback;
  EventLog log;
  std::atomic<std::thread::id> delivering;  ///< the thread that is in the callback
  std::mutex next_turn;
  std::size_t num_taken = 0;  ///< by next
  std::mutex results_mutex;
  std::deque<FrameResult> results;
  OdometryLoops loops;  ///< last, so that its threads end first
};

Expected<AsyncOdometry> AsyncOdometry::create(const Camera& camera,
                                              const Options& options,
                                              const cv::Mat& mask,
                                              Callback callback) {
  Expected<PhasedOdometry> odometry = PhasedOdometry::create(camera, options, mask);
  if (!odometry) {
    return odometry.error();
  }
  try {
    return AsyncOdometry(std::make_unique<Impl>(*std::move(odometry), camera, options.scale.source,
                                                std::move(callback)));
  } catch (const std::system_error& error) {
    return fail(std::string("threads: expected three more, found ") + error.what());
  }
}

AsyncOdometry::AsyncOdometry(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
AsyncOdometry::AsyncOdometry(AsyncOdometry&&) noexcept = default;
AsyncOdometry& AsyncOdometry::operator=(AsyncOdometry&&) noexcept = default;
AsyncOdometry::~AsyncOdometry() = default;

void AsyncOdometry::set_log(Log log) {
  if (impl_ != nullptr) {
    impl_->log.set(std::move(log));
  }
}

Status AsyncOdometry::push(const cv::Mat& image,
                           PixelOrder order,
                           double time_s,
                           const FrameHints& hints) {
  if (impl_ == nullptr) {
    return moved_from();
  }
  Status status = impl_->check_not_in_callback("push");
  if (!status) {
    return status;
  }
  const std::lock_guard lock(impl_->turn);
  status = impl_->check_few_wait();
  status = status ? impl_->check.admit(image, order, time_s, hints) : status;
  if (!status) {
    return status;
  }
  // A live camera writes its next image over this one.
  GivenFrame given{
      order == PixelOrder::kBgr ? rgb_of(image, order) : image.clone(), time_s, hints, {}};
  given.hints.mask = hints.mask.clone();
  {
    const std::lock_guard ways_lock(impl_->ways_mutex);
    given.ways = impl_->ways.take(time_s);
  }
  return impl_->loops.push(std::move(given)) ? Status() : impl_->ended();
}

Expected<std::optional<FrameResult>> AsyncOdometry::next() {
  if (impl_ == nullptr) {
    return moved_from();
  }
  if (impl_->callback) {
    return fail("next: expected results that wait, found a callback that took them");
  }
  const std::lock_guard lock(impl_->next_turn);
  impl_->loops.wait_for(impl_->num_taken);
  const std::lock_guard results_lock(impl_->results_mutex);
  if (!impl_->results.empty()) {
    std::optional<FrameResult> result = std::move(impl_->results.front());
    impl_->results.pop_front();
    ++impl_->num_taken;
    return result;
  }
  if (impl_->loops.has_thrown()) {
    return impl_->ended();
  }
  return std::optional<FrameResult>();
}

Status AsyncOdometry::finish() {
  if (impl_ == nullptr) {
    return moved_from();
  }
  Status status = impl_->check_not_in_callback("finish");
  if (status) {
    const std::lock_guard lock(impl_->turn);
    impl_->loops.finish();
  }
  return status;
}

Status AsyncOdometry::reset() {
  if (impl_ == nullptr) {
    return moved_from();
  }
  Status status = impl_->check_not_in_callback("reset");
  if (status) {
    const std::lock_guard lock(impl_->turn);
    status = impl_->loops.reset() ? status : impl_->ended();
    impl_->check.restart();
    impl_->log.restart();
    const std::lock_guard ways_lock(impl_->ways_mutex);
    impl_->ways.restart();
  }
  return status;
}

Status AsyncOdometry::add_speed(double time_s, double metres_per_s, double sigma) {
  if (impl_ == nullptr) {
    return moved_from();
  }
  const std::lock_guard lock(impl_->ways_mutex);
  return impl_->ways.add_speed(time_s, metres_per_s, sigma);
}

Status AsyncOdometry::add_distance(double from_s, double to_s, double metres, double sigma) {
  if (impl_ == nullptr) {
    return moved_from();
  }
  const std::lock_guard lock(impl_->ways_mutex);
  return impl_->ways.add_distance(from_s, to_s, metres, sigma);
}

MapChanges AsyncOdometry::landmarks_since(int version) const {
  const auto ask = [version](const auto& frames) {
    return stemvo::landmarks_since(frames, version);
  };
  return impl_ ? impl_->loops.ask(ask) : MapChanges();
}
std::vector<MapKeyframe> AsyncOdometry::keyframes(int first) const {
  const auto ask = [first](const auto& frames) { return keyframes_of(frames, first); };
  return impl_ ? impl_->loops.ask(ask) : std::vector<MapKeyframe>();
}
std::vector<TrackedPoint> AsyncOdometry::tracked_points() const {
  return impl_ ? impl_->loops.ask(tracked_points_of) : std::vector<TrackedPoint>();
}
cv::Mat AsyncOdometry::channel_image() const {
  return impl_ ? impl_->loops.ask([](const auto& frames) { return frames.image().pixels; })
               : cv::Mat();
}

Expected<AdjustedMap> AsyncOdometry::adjust_map(const std::vector<int>& covariance_of) const {
  if (impl_ == nullptr) {
    return moved_from();
  }
  return impl_->adjusted_map("adjust_map", covariance_of).map([](const WholeMap& map) {
    return map.answer();
  });
}

Status AsyncOdometry::save_map(const std::filesystem::path& file) const {
  if (impl_ == nullptr) {
    return moved_from();
  }
  return impl_->adjusted_map(file.string(), {}).and_then([&](const WholeMap& map) {
    return impl_->odometry.save_map(file, map);
  });
}

Status AsyncOdometry::load_map(const std::filesystem::path& file) {
  if (impl_ == nullptr) {
    return moved_from();
  }
  const std::lock_guard lock(impl_->turn);
  return impl_->check.check_none_admitted(file.string()).and_then([&] {
    return impl_->odometry.load_map(file);
  });
}

}  // namespace stemvo
