// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/odometry.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Odometry whose frames are worked on beside each other: frames are pushed, results come in their
/// order, with the same bytes as Odometry's and up to six frames later. `options.threads`: above 1
/// there are three threads of its own; with 1 there is none, and push() does the work. Moving it is
/// for the time before the first frame.
class AsyncOdometry {
 public:
  /// Called once for each frame, in order, one call at a time, from a thread of ours (threads 1:
  /// from push). What is asked of the odometry in it belongs to the frame delivered. The next
  /// result waits until it returns.
  using Callback = std::function<void(const FrameResult&)>;

  /// Errors: as Odometry::create; no more threads are to be had. No callback: results wait for
  /// next().
  [[nodiscard]] static Expected<AsyncOdometry> create(const Camera& camera,
                                                      const Options& options = {},
                                                      const cv::Mat& mask = {},
                                                      Callback callback = {});
  AsyncOdometry(AsyncOdometry&&) noexcept;
  AsyncOdometry& operator=(AsyncOdometry&&) noexcept;
  /// Drops frames that are not delivered; waits for a callback that runs.
  ~AsyncOdometry();

  /// As Odometry's, before the first frame; called as the callback, before it.
  void set_log(Log log);

  /// The next frame, as Odometry::process takes it. Its pixels are copied before this returns; it
  /// waits while six frames are at work. Errors: as process, or 1,000 results wait for next(), and
  /// nothing changes then; after finish(), or after a callback threw; in the callback, which would
  /// wait for itself.
  [[nodiscard]] Status push(const cv::Mat& image,
                            PixelOrder order,
                            double time_s,
                            const FrameHints& hints = {});
  /// As those of Odometry: they count from the next frame pushed on.
  [[nodiscard]] Status add_speed(double time_s, double metres_per_s, double sigma);
  [[nodiscard]] Status add_distance(double from_s, double to_s, double metres, double sigma);
  /// The next result; waits for it. nullopt: finish() was called, and this was all. Error: there is
  /// a callback; a frame failed, see finish().
  [[nodiscard]] Expected<std::optional<FrameResult>> next();
  /// No frame follows: waits until all are delivered or wait for next(). Throws again what the
  /// callback threw, or what a frame failed of (memory). Error: called in the callback.
  Status finish();
  /// Waits likewise, then does as Odometry::reset. Error: as push.
  Status reset();

  /// As those of Odometry, from any thread. In the callback they belong to the frame delivered,
  /// elsewhere to some frame lately done.
  [[nodiscard]] MapChanges landmarks_since(int version) const;
  [[nodiscard]] std::vector<MapKeyframe> keyframes(int first = 0) const;
  [[nodiscard]] std::vector<TrackedPoint> tracked_points() const;
  [[nodiscard]] cv::Mat channel_image() const;

  /// As those of Odometry. The first two may be called from any thread, and are of the frames done.
  [[nodiscard]] Expected<AdjustedMap> adjust_map(const std::vector<int>& covariance_of = {}) const;
  [[nodiscard]] Status save_map(const std::filesystem::path& file) const;
  [[nodiscard]] Status load_map(const std::filesystem::path& file);

 private:
  struct Impl;
  explicit AsyncOdometry(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace stemvo
