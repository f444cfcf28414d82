// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include <opencv2/core.hpp>

#include "stemvo/odometry.hpp"

namespace stemvo {

/// Odometry whose frames are worked on beside each other: frames are pushed, results come in their
/// order, with the same bytes as Odometry's and up to six frames later. `options.threads`: above 1
/// there are three threads of its own; with 1 there is none, and push() does the work. Moving it is
/// for the time before the first frame. What is asked of it, from any thread, belongs in the
/// callback to the frame delivered, elsewhere to some frame lately done.
class AsyncOdometry : public OdometryHandle {
 public:
  /// Called once for each frame, in order, behind the log, one call at a time, from a thread of
  /// ours (threads 1: from push). The next result waits until it returns.
  using Callback = std::function<void(const FrameResult&)>;

  /// Errors: as Odometry::create; no more threads are to be had. No callback: results wait for
  /// next().
  [[nodiscard]] static Expected<AsyncOdometry> create(const Camera& camera,
                                                      const Options& options = {},
                                                      const cv::Mat& mask = {},
                                                      Callback callback = {});
  AsyncOdometry(AsyncOdometry&&) noexcept = default;
  AsyncOdometry& operator=(AsyncOdometry&&) noexcept = default;
  /// Drops frames that are not delivered; waits for a callback that runs.
  ~AsyncOdometry() = default;

  /// The next frame, as Odometry::process takes it. Its pixels are copied before this returns; it
  /// waits while six frames are at work. Errors: as process, or 1,000 results wait for next(), and
  /// nothing changes then; after finish(), or after a callback threw; in the callback, which would
  /// wait for itself.
  [[nodiscard]] Status push(const cv::Mat& image,
                            PixelOrder order,
                            double time_s,
                            const FrameHints& hints = {});
  /// The next result; waits for it. nullopt: finish() was called, and this was all. Error: there is
  /// a callback; a frame failed, see finish().
  [[nodiscard]] Expected<std::optional<FrameResult>> next();
  /// No frame follows: waits until all are delivered or wait for next(). Throws again what the
  /// callback threw, or what a frame failed of (memory). Error: called in the callback.
  Status finish();
  /// Waits likewise, then does as Odometry::reset. Error: as push.
  Status reset();

 private:
  explicit AsyncOdometry(std::unique_ptr<Impl> impl);
};

}  // namespace stemvo
