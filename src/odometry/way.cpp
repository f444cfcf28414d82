// SPDX-License-Identifier: MIT
#include "odometry/way.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "odometry/check_frame.hpp"
#include "odometry/frame_clock.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

/// Between speeds farther apart than this the camera may have stood and gone again.
constexpr double kMaxGap_s = 1.5;
/// More is what sensors send that have no answer (65535), not what carries a camera.
constexpr double kMaxSpeed = 1000.0;

Status check_source(ScaleSource source) {
  return source == ScaleSource::kConstantSpeed
             ? Status(fail("scale.source: expected none or camera_height, which a speed or a "
                           "distance can add to, found constant_speed"))
             : Status();
}

Status check_sigma(const char* name, double sigma) {
  return sigma > 0.0 && std::isfinite(sigma)
             ? Status()
             : Status(fail(fmt::format("{}: expected a sigma above 0, found {}", name, sigma)));
}

/// A station is so many pixels of motion from the one before, and its place known to so many.
constexpr double kStation_px = 1.0;
constexpr double kPlace_px = 0.05;
/// A camera that stands tells nothing, however long: its path begins anew after so long.
constexpr double kMaxStay_s = 2.0;
constexpr double kMemory_s = 30.0;
/// Ways join where one begins as the other ends.
constexpr double kSameTime_s = 1e-6;
/// A way that is no longer than so many of its sigmas may be none.
constexpr double kMinWaySigmas = 3.0;

}  // namespace

double usual_speed_sigma(double metres_per_s) {
  constexpr double kShare = 0.02;
  constexpr double kMin = 0.05;
  return std::max(kMin, kShare * std::abs(metres_per_s));
}

Status WayInput::add_speed(double time_s, double metres_per_s, std::optional<double> given_sigma) {
  STEMVO_TRY(check_source(source_));
  const auto last_s = last_speed_ ? std::optional(last_speed_->time_s) : std::nullopt;
  STEMVO_TRY(check_time("speed", time_s, last_s, "speed"));
  if (!(std::abs(metres_per_s) <= kMaxSpeed)) {
    return fail(fmt::format("speed: expected -{0} to {0} m/s, found {1}", kMaxSpeed, metres_per_s));
  }
  const double sigma = given_sigma.value_or(usual_speed_sigma(metres_per_s));
  STEMVO_TRY(check_sigma("speed", sigma));
  const Speed now{time_s, std::abs(metres_per_s), sigma};
  if (last_speed_ && time_s - last_speed_->time_s <= kMaxGap_s) {
    // Each speed counts in two ways: with half of its error in each, their errors would pass for
    // independent ones.
    const double duration_s = whole_us(time_s - last_speed_->time_s);
    ways_.push_back({last_speed_->time_s, time_s,
                     0.5 * duration_s * (last_speed_->metres_per_s + now.metres_per_s),
                     duration_s * std::hypot(last_speed_->sigma, sigma) / std::sqrt(2.0),
                     Way::Kind::kBetweenSpeeds});
  }
  last_speed_ = now;
  return {};
}

Status WayInput::add_distance(double from_s, double to_s, double metres, double sigma) {
  STEMVO_TRY(check_source(source_));
  STEMVO_TRY(check_time("distance", from_s, std::nullopt, "distance"));
  STEMVO_TRY(check_time("distance", to_s, last_to_s_, "distance"));
  STEMVO_TRY(check_sigma("distance", sigma));
  if (!(from_s < to_s)) {
    return fail(fmt::format("distance: expected a time after its beginning, {} s, found {} s",
                            from_s, to_s));
  }
  if (!(metres >= 0.0 && metres <= kMaxSpeed * (to_s - from_s))) {
    return fail(fmt::format("distance: expected 0 m to {} m a second, found {} m in {} s",
                            kMaxSpeed, metres, to_s - from_s));
  }
  last_to_s_ = to_s;
  ways_.push_back({from_s, to_s, metres, sigma, Way::Kind::kDistance});
  return {};
}

std::vector<Way> WayInput::take(double time_s) {
  std::vector<Way> ways = std::exchange(ways_, {});
  const double held_s = last_speed_ ? whole_us(time_s - last_speed_->time_s) : -1.0;
  if (held_s > 0.0 && held_s <= kMaxGap_s) {
    ways.push_back({last_speed_->time_s, time_s, held_s * last_speed_->metres_per_s,
                    held_s * last_speed_->sigma, Way::Kind::kHeld});
  }
  return ways;
}

void WayScale::move(const Rigid3& cur_from_prev, double time_s, double pixel_units) {
  if (stations_.empty()) {
    restart(time_s);
    return;
  }
  const auto waits = [](const Queue& queue) { return !queue.waiting.empty(); };
  if (std::ranges::any_of(queues_, waits)) {
    const double silence_s = time_s - std::exchange(last_heard_s_, time_s);
    longest_silence_s_ = last_ ? std::max(longest_silence_s_, silence_s) : longest_silence_s_;
  }
  pixel_units_ = pixel_units;
  now_from_station_ = cur_from_prev * now_from_station_;
  const double moved = now_from_station_.translation.norm();
  if (time_s - stations_.back().time_s > kMaxStay_s) {
    restart(time_s);
  } else if (moved > 0.0 && moved >= kStation_px * pixel_units) {
    stations_.push_back({time_s, stations_.back().length + moved});
    now_from_station_ = {};
  }
  while (stations_.front().time_s < time_s - kMemory_s) {
    stations_.pop_front();
  }
}

bool WayScale::measure(Queue& queue, ScaleFilter& filter) {
  auto& [waiting, joined] = queue;
  // Ways that have ended are one.
  for (; !waiting.empty() && waiting.front().to_s <= stations_.back().time_s; waiting.pop_front()) {
    const Way& way = waiting.front();
    if (joined && std::abs(way.from_s - joined->to_s) < kSameTime_s) {
      joined->to_s = way.to_s;
      joined->metres += way.metres;
      joined->sigma_m = std::hypot(joined->sigma_m, way.sigma_m);
    } else {
      joined = way;
    }
    if (joined->from_s < stations_.front().time_s) {
      joined.reset();
    }
  }
  if (!joined) {
    return false;
  }
  const Way& way = *joined;
  const double units = length_at(way.to_s) - length_at(way.from_s);
  if (!(units > 0.0 && units >= kStation_px * pixel_units_ &&
        way.metres > kMinWaySigmas * way.sigma_m)) {
    return false;  // goes on
  }
  const double drift = kMapDrift * (stations_.back().time_s - 0.5 * (way.from_s + way.to_s));
  const double sigma = std::hypot(way.sigma_m / way.metres, drift,
                                  std::sqrt(2.0) * kPlace_px * pixel_units_ / units);
  told_ = std::log(way.metres / units);
  const bool is_believed = filter.update(*told_, sigma, ScaleWitness::kWay);
  last_ = last_ && last_->to_s > way.to_s ? last_ : way;
  joined.reset();
  return is_believed;
}

void WayScale::guess(ScaleFilter& filter) const {
  double metres = 0.0;
  double units = 0.0;
  const auto add_part = [&](const Way& way) {
    const double from_s = std::max(way.from_s, stations_.front().time_s);
    const double to_s = std::min(way.to_s, stations_.back().time_s);
    if (from_s < to_s) {
      metres += way.metres * (to_s - from_s) / (way.to_s - way.from_s);
      units += length_at(to_s) - length_at(from_s);
    }
  };
  for (const Queue& queue : queues_) {
    std::ranges::for_each(queue.waiting, add_part);
    if (queue.joined) {
      add_part(*queue.joined);
    }
  }
  if (held_) {
    add_part(*held_);
  }
  if (metres > 0.0 && units > 0.0) {
    filter.update(std::log(metres / units), ScaleFilter::kUnknownSigma, ScaleWitness::kWay);
  }
}

bool WayScale::measure(ScaleFilter& filter) {
  bool is_believed = false;
  told_.reset();
  if (!stations_.empty()) {
    for (Queue& queue : queues_) {
      is_believed = measure(queue, filter) || is_believed;
    }
    if (!filter.is_initialized()) {
      guess(filter);
    }
  }
  return is_believed;
}

}  // namespace stemvo
