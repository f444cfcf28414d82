// SPDX-License-Identifier: MIT
#include "odometry/way.hpp"

#include <cmath>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "odometry/frame_clock.hpp"

namespace stemvo {
namespace {

/// Between speeds farther apart than this the camera may have stood and gone again.
constexpr double kMaxGap_s = 1.5;

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

constexpr double kNever_s = -std::numeric_limits<double>::infinity();

Status check_time(const char* name, double time_s, double last_s) {
  if (std::isfinite(time_s) && time_s > last_s) {
    return {};
  }
  const std::string expected = std::isfinite(last_s)
                                   ? fmt::format("a time after the last one's, {} s", last_s)
                                   : "a finite time";
  return fail(fmt::format("{}: expected {}, found {} s", name, expected, time_s));
}

}  // namespace

Status WayInput::add_speed(double time_s, double metres_per_s, double sigma) {
  Status status = check_source(source_);
  status =
      status ? check_time("speed", time_s, last_speed_ ? last_speed_->time_s : kNever_s) : status;
  status = status ? check_sigma("speed", sigma) : status;
  if (status && !std::isfinite(metres_per_s)) {
    status = fail(fmt::format("speed: expected a number of m/s, found {}", metres_per_s));
  }
  if (!status) {
    return status;
  }
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
  Status status = check_source(source_);
  status = status ? check_time("distance", from_s, kNever_s) : status;
  status = status ? check_time("distance", to_s, last_to_s_) : status;
  status = status ? check_sigma("distance", sigma) : status;
  if (status && !(from_s < to_s)) {
    status = fail(fmt::format("distance: expected a time after its beginning, {} s, found {} s",
                              from_s, to_s));
  }
  if (status && !(metres >= 0.0 && std::isfinite(metres))) {
    status = fail(fmt::format("distance: expected at least 0 m, found {}", metres));
  }
  if (status) {
    last_to_s_ = to_s;
    ways_.push_back({from_s, to_s, metres, sigma, Way::Kind::kDistance});
  }
  return status;
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

}  // namespace stemvo
