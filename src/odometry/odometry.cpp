// SPDX-License-Identifier: MIT
#include "stemvo/odometry.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <deque>
#include <mutex>
#include <span>
#include <string_view>
#include <system_error>
#include <thread>

#include "geometry/radial_lens.hpp"
#include "odometry/check_frame.hpp"
#include "odometry/event_log.hpp"
#include "odometry/odometry_loops.hpp"
#include "odometry/whole_map.hpp"
#include "stemvo/async_odometry.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

/// Each holds a pose and a few numbers; a program that never asks for them shall hear of it.
constexpr std::size_t kMaxWaiting = 1000;

Status check_in_use(const auto& impl) {
  return impl ? Status() : fail("odometry: expected an object in use, found one moved from");
}

MapChanges landmarks_of(const ChannelOdometry& frames, int version) {
  const Estimator& estimator = frames.estimator();
  LandmarkChanges changes = estimator.landmarks_since(version);
  MapChanges placed{changes.version, {}, std::move(changes.removed)};
  for (const KeptLandmark& kept : changes.landmarks) {
    const Rigid3& world_from_camera = estimator.trajectory()[static_cast<std::size_t>(kept.frame)];
    placed.landmarks.push_back(
        {kept.id, world_from_camera * kept.in_camera.cast<double>(), kept.rgb});
  }
  return placed;
}

std::vector<MapKeyframe> keyframes_of(const ChannelOdometry& frames, int first) {
  const std::span<const int> all = frames.estimator().keyframes();
  std::vector<MapKeyframe> keyframes;
  for (auto id = static_cast<std::size_t>(std::max(first, 0)); id < all.size(); ++id) {
    const auto frame = static_cast<std::size_t>(all[id]);
    keyframes.push_back({static_cast<int>(id), all[id], frames.times_s()[frame],
                         frames.estimator().trajectory()[frame]});
  }
  return keyframes;
}

std::vector<TrackedPoint> tracked_points_of(const ChannelOdometry& frames) {
  const Matches& matches = frames.matches();
  const std::vector<char>& is_inlier = frames.inlier_mask();
  const RadialLens& lens = frames.image().map.lens;  // the points are shown on the frame
  std::vector<TrackedPoint> points;
  for (std::size_t i = 0; i < matches.track_ids.size(); ++i) {
    points.push_back({matches.track_ids[i], lens.distort(matches.prev_uv[i]),
                      lens.distort(matches.cur_uv[i]), i < is_inlier.size() && is_inlier[i] != 0});
  }
  return points;
}

}  // namespace

std::string_view to_string(FrameState state) {
  constexpr std::array<std::string_view, 9> kNames{"first",      "initializing", "tracking",
                                                   "stationary", "low_parallax", "rotating",
                                                   "gated",      "lost",         "no_image"};
  static_assert(kNames.size() == static_cast<std::size_t>(FrameState::kNoImage) + 1);
  return kNames.at(static_cast<std::size_t>(state));
}

bool is_measured(FrameState state) {
  return state != FrameState::kGated && state != FrameState::kLost && state != FrameState::kNoImage;
}

std::string_view to_string(ScaleState state) {
  constexpr std::array<std::string_view, 4> kNames{"disabled", "none", "held", "measured"};
  static_assert(kNames.size() == static_cast<std::size_t>(ScaleState::kMeasured) + 1);
  return kNames.at(static_cast<std::size_t>(state));
}

struct OdometryHandle::Impl {
  Impl(PhasedOdometry given,
       const Camera& camera,
       const Options& options,
       int num_threads,
       AsyncOdometry::Callback on_result)
      : odometry(std::move(given)),
        check(camera),
        ways(options.scale.source),
        callback(std::move(on_result)),
        loops(
            odometry,
            [this](const GivenFrame&, const FrameResult& result) {
              deliver(result);
              return true;
            },
            num_threads) {}

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
  /// Why the loops take no frame.
  [[nodiscard]] Error ended() const {
    return fail(loops.has_thrown()
                    ? "the odometry has ended: an earlier frame or its callback failed, and "
                      "finish() throws why"
                    : "expected no frame after finish(), found one");
  }

  /// `is_kept`: the pixels stay as they are until the frame is done; else they are copied.
  [[nodiscard]] Status push(const cv::Mat& image,
                            PixelOrder order,
                            double time_s,
                            const FrameHints& hints,
                            bool is_kept) {
    STEMVO_TRY(check_not_in_callback("push"));
    const std::lock_guard lock(turn);
    if (const std::lock_guard results_lock(results_mutex); results.size() >= kMaxWaiting) {
      return fail("push: expected next() to take the results, found " +
                  std::to_string(results.size()) + " that wait for it");
    }
    STEMVO_TRY(check.admit(image, order, time_s, hints));
    GivenFrame given{rgb_of(image, order), time_s, hints, {}};
    if (!is_kept) {
      given.image = given.image->data == image.data ? image.clone() : *given.image;
      given.hints.mask = hints.mask.clone();
    }
    {
      const std::lock_guard ways_lock(ways_mutex);
      given.ways = ways.take(time_s);
    }
    return loops.push(std::move(given)) ? Status() : ended();
  }
  /// The first result that waits.
  [[nodiscard]] std::optional<FrameResult> take() {
    const std::lock_guard lock(results_mutex);
    if (results.empty()) {
      return std::nullopt;
    }
    std::optional<FrameResult> result = std::move(results.front());
    results.pop_front();
    ++num_taken;
    return result;
  }
  [[nodiscard]] Status reset() {
    STEMVO_TRY(check_not_in_callback("reset"));
    const std::lock_guard lock(turn);
    if (!loops.reset()) {
      return loops.has_thrown() ? ended() : fail("reset: expected none after finish(), found one");
    }
    check.restart();
    log.restart();
    const std::lock_guard ways_lock(ways_mutex);
    ways.restart();
    return {};
  }

  [[nodiscard]] Expected<WholeMap> adjusted_map(const std::string& asked,
                                                const std::vector<int>& covariance_of) const {
    STEMVO_TRY(odometry.check_remembers(asked));
    WholeMap map = loops.ask([&](const auto&) { return WholeMap(odometry); });
    STEMVO_TRY(map.adjust(covariance_of));
    return map;
  }

  PhasedOdometry odometry;
  std::mutex turn;  ///< of push, finish and reset
  FrameCheck check;
  std::mutex ways_mutex;
  WayInput ways;
  AsyncOdometry::Callback callback;
  EventLog log;
  std::atomic<std::thread::id> delivering;  ///< the thread that is in the callback
  std::mutex next_turn;
  std::size_t num_taken = 0;
  std::mutex results_mutex;
  std::deque<FrameResult> results;
  OdometryLoops loops;  ///< last, so that its threads end first
};

OdometryHandle::OdometryHandle(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Odometry::Odometry(std::unique_ptr<Impl> impl) : OdometryHandle(std::move(impl)) {}
AsyncOdometry::AsyncOdometry(std::unique_ptr<Impl> impl) : OdometryHandle(std::move(impl)) {}
OdometryHandle::OdometryHandle(OdometryHandle&&) noexcept = default;
OdometryHandle& OdometryHandle::operator=(OdometryHandle&&) noexcept = default;
OdometryHandle::~OdometryHandle() = default;

void OdometryHandle::set_log(Log log) {
  if (impl_ != nullptr) {
    if (const auto doubt = doubt_of(impl_->odometry.view().camera()); log && !doubt.empty()) {
      log(LogLevel::kWarning, doubt);
    }
    impl_->log.set(std::move(log));
  }
}

Status OdometryHandle::add_speed(double time_s, double metres_per_s, std::optional<double> sigma) {
  STEMVO_TRY(check_in_use(impl_));
  const std::lock_guard lock(impl_->ways_mutex);
  return impl_->ways.add_speed(time_s, metres_per_s, sigma);
}

Status OdometryHandle::add_distance(double from_s, double to_s, double metres, double sigma) {
  STEMVO_TRY(check_in_use(impl_));
  const std::lock_guard lock(impl_->ways_mutex);
  return impl_->ways.add_distance(from_s, to_s, metres, sigma);
}

MapChanges OdometryHandle::landmarks_since(int version) const {
  const auto ask = [version](const auto& frames) { return landmarks_of(frames, version); };
  return impl_ ? impl_->loops.ask(ask) : MapChanges();
}
std::vector<MapKeyframe> OdometryHandle::keyframes(int first) const {
  const auto ask = [first](const auto& frames) { return keyframes_of(frames, first); };
  return impl_ ? impl_->loops.ask(ask) : std::vector<MapKeyframe>();
}
std::vector<TrackedPoint> OdometryHandle::tracked_points() const {
  return impl_ ? impl_->loops.ask(tracked_points_of) : std::vector<TrackedPoint>();
}
cv::Mat OdometryHandle::channel_image() const {
  return impl_ ? impl_->loops.ask([](const auto& frames) { return frames.image().pixels; })
               : cv::Mat();
}

Expected<AdjustedMap> OdometryHandle::adjust_map(const std::vector<int>& covariance_of) const {
  STEMVO_TRY(check_in_use(impl_));
  STEMVO_TRY_GET(const WholeMap map, impl_->adjusted_map("adjust_map", covariance_of));
  return map.answer();
}

Status OdometryHandle::save_map(const std::filesystem::path& file) const {
  STEMVO_TRY(check_in_use(impl_));
  STEMVO_TRY_GET(const WholeMap map, impl_->adjusted_map(file.string(), {}));
  return impl_->odometry.save_map(file, map.kept);
}

Status OdometryHandle::load_map(const std::filesystem::path& file) {
  STEMVO_TRY(check_in_use(impl_));
  STEMVO_TRY(impl_->check_not_in_callback("load_map"));
  const std::lock_guard lock(impl_->turn);
  STEMVO_TRY(impl_->check.check_none_admitted(file.string()));
  return impl_->odometry.load_map(file);
}

Expected<Odometry> Odometry::create(const Camera& camera,
                                    const Options& options,
                                    const cv::Mat& mask) {
  STEMVO_TRY_GET(PhasedOdometry odometry, PhasedOdometry::create(camera, options, mask));
  return Odometry(std::make_unique<Impl>(std::move(odometry), camera, options, 1, nullptr));
}

Expected<FrameResult> Odometry::process(const cv::Mat& image,
                                        PixelOrder order,
                                        double time_s,
                                        const FrameHints& hints) {
  STEMVO_TRY(check_in_use(impl_));
  const Status status = impl_->push(image, order, time_s, hints, true);
  if (impl_->loops.has_thrown()) {
    impl_->loops.finish();  // throws it
  }
  return status ? *impl_->take() : Expected<FrameResult>(status.error());
}

void Odometry::reset() {
  if (impl_ != nullptr) {
    (void)impl_->reset();
  }
}

Expected<AsyncOdometry> AsyncOdometry::create(const Camera& camera,
                                              const Options& options,
                                              const cv::Mat& mask,
                                              Callback callback) {
  STEMVO_TRY_GET(PhasedOdometry odometry, PhasedOdometry::create(camera, options, mask));
  const int num_threads = odometry.num_threads();
  try {
    return AsyncOdometry(std::make_unique<Impl>(std::move(odometry), camera, options, num_threads,
                                                std::move(callback)));
  } catch (const std::system_error& error) {
    return fail(std::string("threads: expected three more, found ") + error.what());
  }
}

Status AsyncOdometry::push(const cv::Mat& image,
                           PixelOrder order,
                           double time_s,
                           const FrameHints& hints) {
  STEMVO_TRY(check_in_use(impl_));
  return impl_->push(image, order, time_s, hints, false);
}

Expected<std::optional<FrameResult>> AsyncOdometry::next() {
  STEMVO_TRY(check_in_use(impl_));
  if (impl_->callback) {
    return fail("next: expected results that wait, found a callback that took them");
  }
  const std::lock_guard lock(impl_->next_turn);
  impl_->loops.wait_for(impl_->num_taken);
  std::optional<FrameResult> result = impl_->take();
  if (!result && impl_->loops.has_thrown()) {
    return impl_->ended();
  }
  return result;
}

Status AsyncOdometry::finish() {
  STEMVO_TRY(check_in_use(impl_));
  STEMVO_TRY(impl_->check_not_in_callback("finish"));
  const std::lock_guard lock(impl_->turn);
  impl_->loops.finish();
  return {};
}

Status AsyncOdometry::reset() {
  STEMVO_TRY(check_in_use(impl_));
  return impl_->reset();
}

}  // namespace stemvo
